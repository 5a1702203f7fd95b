"""Datasets as files: CSV for every program, netCDF with everything."""

from __future__ import annotations

import tempfile
from pathlib import Path

import xarray as xr


def storable(data: xr.Dataset) -> xr.Dataset:
    """The dataset with names that files can hold.

    A slash separates groups in netCDF; it becomes " per " and the name as it was stays as ``long_name``.
    """
    names = {str(name): str(name).replace("/", " per ") for name in data.variables if "/" in str(name)}
    renamed = data.rename(names)
    for name, new in names.items():
        renamed[new].attrs["long_name"] = name
    return renamed


def csv(data: xr.Dataset) -> str:
    """A table with one line per point, units in the header, attributes in comment lines (#) above it."""
    table = storable(data)
    frame = table.to_dataframe().reset_index()
    units = {str(name): variable.attrs.get("units", "") for name, variable in table.variables.items()}
    frame = frame.rename(columns={name: f"{name} [{unit}]" for name, unit in units.items() if unit})
    notes = "".join(f"# {key} = {value}\n" for key, value in table.attrs.items())
    return notes + str(frame.to_csv(index=False, lineterminator="\n"))


def netcdf(data: xr.Dataset) -> bytes:
    """The bytes of a netCDF-4 file."""
    with tempfile.TemporaryDirectory(prefix="chilopod-") as folder:
        path = Path(folder) / "data.nc"
        storable(data).to_netcdf(path, engine="h5netcdf")
        return path.read_bytes()
