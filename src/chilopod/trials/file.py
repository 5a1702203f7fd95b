"""The file of one record: netCDF-3 with a seal behind it."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.io import netcdf_file

from chilopod.errors import OutputError, in_words
from chilopod.netcdf import UnsoundError, sealed, sealed_file, unsealed

_DAMAGES = (ValueError, TypeError, LookupError, AttributeError, OverflowError)


@dataclass(frozen=True)
class Header:
    """Attributes of a record as text, and size of its file, bytes."""

    attributes: Mapping[str, str]
    size: int


def content_of(record: xr.Dataset) -> bytes:
    """Bytes of a record's file. Raises OutputError for types other than floating-point numbers, integers of 32 bits,
    truth values and text, and for a dimension of length 0."""
    if not all(record.sizes.values()):
        sizes = {str(name): size for name, size in record.sizes.items()}
        raise OutputError("must not have a dimension of length 0", field="record", value=sizes)
    buffer = io.BytesIO()
    # Directly, for xarray takes ten times as long as the walk of a short trial.
    file = netcdf_file(buffer, "w", version=2)
    for name, size in record.sizes.items():
        file.createDimension(str(name), size)
    aside = " ".join(str(name) for name in record.coords if name not in record.dims)
    _describe(file, "record", record.attrs | ({"coordinates": aside} if aside else {}))
    for name, variable in record.variables.items():
        values, added = _as_stored(f"record.{name}", variable.values)
        over = [str(each) for each in variable.dims]
        if values.ndim > variable.ndim:
            over.append(f"string{values.shape[-1]}")
            if over[-1] not in file.dimensions:
                file.createDimension(over[-1], values.shape[-1])
        stored = file.createVariable(str(name), values.dtype, over)
        _describe(stored, f"record.{name}", variable.attrs | added)
        stored.data[...] = values
    file.flush()
    return sealed(buffer.getvalue())


def _as_stored(field: str, values: NDArray[Any]) -> tuple[NDArray[Any], dict[str, str]]:
    """Values in the form of the file, text with one more dimension, and attributes that readers need."""
    kind = values.dtype.kind
    if kind == "f":
        return values, {}
    if kind in "biu" and np.array_equal(values.astype(np.int32), values):
        return values.astype(np.int32), {"dtype": "bool"} if kind == "b" else {}
    if kind == "U" or (kind == "O" and all(isinstance(each, str) for each in values.flat)):
        encoded = np.char.encode(values.astype(str), "utf-8")
        encoded = encoded.astype(f"S{max(1, encoded.dtype.itemsize)}")
        return encoded[..., None].view("S1"), {"_Encoding": "utf-8"}
    raise OutputError("must be of a type that netCDF can hold", field=field, value=str(values.dtype))


def _describe(target: Any, field: str, attributes: Mapping[Any, Any]) -> None:
    for name, value in attributes.items():
        if not isinstance(value, str | bool | int | float | np.number):
            raise OutputError("must be of a type that netCDF can hold", field=f"{field}.attrs[{name!r}]", value=value)
        setattr(target, str(name), value.encode() if isinstance(value, str) else np.float64(value))


def read_record(path: Path) -> xr.Dataset:
    """Read a record with its original types and without attributes of the file. Raises the errors of
    :func:`chilopod.netcdf.unsealed`."""
    try:
        record = xr.load_dataset(io.BytesIO(unsealed(path)), engine="scipy").drop_encoding()
    except UnsoundError:
        raise
    except _DAMAGES as error:  # the seal is valid but the content is foreign
        raise UnsoundError(f"cannot be read ({in_words(error)})") from None
    record.attrs = {name: value if isinstance(value, str) else float(value) for name, value in record.attrs.items()}
    # The file has integers of 32 bits only, and all text is read as objects.
    whole = {name: each.astype(np.int64) for name, each in record.data_vars.items() if each.dtype == np.int32}
    kinds = {np.dtype(np.int32): np.int64, np.dtype(object): str}
    wider = {name: each.astype(kinds[each.dtype]) for name, each in record.coords.items() if each.dtype in kinds}
    return record.assign(whole).assign_coords(wider)


def read_header(path: Path, *, whole: bool = False) -> Header:
    """Read the header of a record's file and check the whole file against its seal if ``whole``, otherwise only its
    length. Raises the errors of :func:`chilopod.netcdf.unsealed`."""
    if whole:
        unsealed(path)
    with sealed_file(path) as file:
        try:
            with netcdf_file(file, mmap=True) as front:
                attributes = {name: value for name, value in vars(front).items() if isinstance(value, bytes)}
                return Header({name: value.decode() for name, value in attributes.items()}, file.seek(0, io.SEEK_END))
        except _DAMAGES:
            raise UnsoundError("is damaged or was edited") from None
