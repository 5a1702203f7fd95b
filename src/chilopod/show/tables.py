"""Datasets as tables that every program reads."""

from __future__ import annotations

import xarray as xr

from chilopod.netcdf import storable


def csv(data: xr.Dataset) -> str:
    """A table with one line per point, units in the header, attributes in comment lines (#) above it."""
    table = storable(data)
    frame = table.to_dataframe().reset_index()
    units = {str(name): variable.attrs.get("units", "") for name, variable in table.variables.items()}
    frame = frame.rename(columns={name: f"{name} [{unit}]" for name, unit in units.items() if unit})
    notes = "".join(f"# {key} = {value}\n" for key, value in table.attrs.items())
    return notes + str(frame.to_csv(index=False, lineterminator="\n"))
