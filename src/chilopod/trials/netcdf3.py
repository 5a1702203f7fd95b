"""Records as netCDF-3 files, written straight from their arrays: ten times as fast as by way of a general writer."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import OutputError

if TYPE_CHECKING:
    import xarray as xr

_CHAR, _INT, _FLOAT, _DOUBLE = 2, 4, 5, 6
_STORED = {_CHAR: "S1", _INT: ">i4", _FLOAT: ">f4", _DOUBLE: ">f8"}
_DIMENSION, _VARIABLE, _ATTRIBUTE = 10, 11, 12


def encode(record: xr.Dataset, attributes: Mapping[str, str]) -> bytearray:
    """The bytes of a file that :func:`xarray.open_dataset` reads.

    Parameters
    ----------
    record
        Of floating-point numbers, integers of 32 bits, truth values and text, no dimension of length 0.
    attributes
        Beside those of the record, and before them.

    Raises
    ------
    OutputError
        If it holds something else.
    """
    dimensions = {str(name): int(size) for name, size in record.sizes.items()}
    variables = []
    for name, variable in record.variables.items():
        kind, values, added = _as_stored(str(name), variable.values)
        over = [str(each) for each in variable.dims]
        if kind == _CHAR:
            over.append(f"string{values.shape[-1]}")
            dimensions[over[-1]] = values.shape[-1]
        variables.append((str(name), over, kind, values, {**variable.attrs, **added}))
    if not all(dimensions.values()):
        raise OutputError("has a dimension of length 0 and cannot be kept", field="record", value=dimensions)
    aside = [str(name) for name in record.coords if name not in record.dims]
    told = {**attributes, **record.attrs, **({"coordinates": " ".join(aside)} if aside else {})}

    number = {name: index for index, name in enumerate(dimensions)}
    front = b"".join(
        [
            b"CDF\x02" + struct.pack(">i", 0),
            _list(_DIMENSION, [_name(name) + struct.pack(">i", size) for name, size in dimensions.items()]),
            _attributes(told),
            struct.pack(">ii", _VARIABLE, len(variables)),
        ]
    )
    heads = [
        _name(name)
        + struct.pack(f">{1 + len(over)}i", len(over), *(number[each] for each in over))
        + _attributes(attrs)
        for name, over, _, _, attrs in variables
    ]
    sizes = [-(-values.size * np.dtype(_STORED[kind]).itemsize // 4) * 4 for _, _, kind, values, _ in variables]
    begin = len(front) + sum(map(len, heads)) + 16 * len(variables)
    content = bytearray(begin + sum(sizes))
    for head, size, (_, _, kind, values, _) in zip(heads, sizes, variables, strict=True):
        # Where a size has no room it is not looked at.
        front += head + struct.pack(">iIq", kind, min(size, 2**32 - 4), begin)
        stored = np.frombuffer(content, dtype=_STORED[kind], count=values.size, offset=begin)
        stored.reshape(values.shape)[...] = values
        begin += size
    content[: len(front)] = front
    return content


def _as_stored(name: str, values: NDArray[Any]) -> tuple[int, NDArray[Any], dict[str, str]]:
    """Type in the file, values of it, and what readers must know."""
    kind = values.dtype.kind
    if kind == "f":
        return (_FLOAT if values.dtype.itemsize == 4 else _DOUBLE), values, {}
    if kind == "b":
        return _INT, values, {"dtype": "bool"}
    if kind in "iu" and np.array_equal(values.astype(np.int32), values):
        return _INT, values, {}
    if kind == "U" or (kind == "O" and all(isinstance(each, str) for each in values.flat)):
        encoded = np.char.encode(values.astype(str), "utf-8")
        encoded = encoded.astype(f"S{max(1, encoded.dtype.itemsize)}")
        return _CHAR, encoded[..., None].view("S1"), {"_Encoding": "utf-8"}
    raise OutputError("cannot be kept in a file", field=f"record.{name}", value=str(values.dtype))


def _attributes(attributes: Mapping[Any, Any]) -> bytes:
    return _list(_ATTRIBUTE, [_name(str(name)) + _value(str(name), value) for name, value in attributes.items()])


def _value(name: str, value: object) -> bytes:
    if isinstance(value, str):
        text = value.encode()
        return struct.pack(">ii", _CHAR, len(text)) + _padded(text)
    if isinstance(value, bool | int | float | np.number):
        return struct.pack(">iid", _DOUBLE, 1, float(value))
    raise OutputError("cannot be kept in a file", field=f"record.attrs[{name!r}]", value=value)


def _list(tag: int, items: Iterable[bytes]) -> bytes:
    items = list(items)
    return struct.pack(">ii", tag if items else 0, len(items)) + b"".join(items)


def _name(name: str) -> bytes:
    text = name.encode()
    return struct.pack(">i", len(text)) + _padded(text)


def _padded(text: bytes) -> bytes:
    return text + b"\0" * (-len(text) % 4)
