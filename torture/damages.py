"""What happens to saved files: bits, ends, blocks, places, and what was edited."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np
import xarray as xr

from in_process import Place

Files = dict[str, bytes]
SPARSE = 1 << 40  # bytes that take no room


def on_bytes(content: bytes, chance: Random) -> bytes:
    """The content of a file after some accident."""
    size = len(content)
    at, length = chance.randrange(size), chance.choice((1, 8, 64, 512, 4096, size))
    # Densely where the structure is described.
    front = chance.randrange(min(size, 4096))
    other = chance.randrange(size)
    return chance.choice(
        (
            lambda: _flipped(content, [at]),
            lambda: _flipped(content, [front]),
            lambda: _flipped(content, [front, at, other]),
            lambda: _flipped(content, [(front + k) % size for k in range(8)]),
            lambda: content[:at],
            lambda: content[:front],
            lambda: b"",
            lambda: content + bytes(length),
            lambda: content + content,
            lambda: content[:at] + bytes(min(length, size - at)) + content[at + length :],
            lambda: content[:at] + b"\xff" * min(length, size - at) + content[at + length :],
            lambda: content[:at] + content[at + length :],
            lambda: content[:at] + content[other : other + length] + content[at:],
            lambda: content[:at] + content[other : other + length] + content[at + length :],
            lambda: chance.randbytes(size),
            lambda: content[:front] + chance.randbytes(4) + content[front + 4 :],
            lambda: content[::-1],
        )
    )()


def _flipped(content: bytes, places: list[int]) -> bytes:
    bits = bytearray(content)
    for at in places:
        bits[at] ^= 1 << (at * 7 + len(places)) % 8
    return bytes(bits)


def edited(path: Path, chance: Random, engine: str, attributes: Callable[[xr.Dataset], dict[str, object]]) -> None:
    """Read a file, change something as one would in a notebook, and write it again."""
    with xr.open_dataset(path, engine=engine) as opened:
        data = opened.load()
    name = chance.choice([str(each) for each in data.variables])
    how = chance.randrange(6)
    if how == 0 and data[name].dtype.kind == "f":
        data[name] = data[name] * (1.0 + 2.0**-40)
    elif how == 1 and data[name].dtype.kind == "f":
        values = np.array(data[name].values)
        values.flat[chance.randrange(values.size)] = chance.choice((np.nan, 0.0, 1e300, -1.0, np.inf))
        data[name] = (data[name].dims, values)
    elif how == 2:
        data = data.drop_vars(name)
    elif how == 3:
        data = data.rename({name: f"{name}2"})
    elif how == 4:
        dimension = chance.choice([str(each) for each in data.sizes])
        data = data.isel({dimension: slice(0, max(1, data.sizes[dimension] // 2))})
    else:
        attribute, value = chance.choice(list(attributes(data).items()))
        data.attrs[attribute] = value
    options = {"format": "NETCDF3_64BIT"} if engine == "scipy" else {}
    path.unlink()
    data.to_netcdf(path, engine=engine, **options)


def replaced(path: Path, chance: Random, place: Place) -> None:
    """Put something else where a file was."""
    content = path.read_bytes()
    path.unlink()
    how = chance.randrange(7)
    if how == 0:
        path.mkdir()
    elif how == 1:
        os.mkfifo(path)
    elif how == 2:
        path.symlink_to("nowhere")
    elif how == 3:
        path.symlink_to(path.name)
    elif how == 4:
        other = place.here / "elsewhere"
        other.write_bytes(content[: len(content) // 2])
        path.symlink_to(other)
    elif how == 5:
        with path.open("wb") as file:
            file.truncate(SPARSE)
    else:
        path.mkdir()
        (path / "precious").write_text("precious")
