"""Saved walks as bytes: plain arrays and text in numpy's zip format, with a checksum and without pickles."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np

from chilopod.engine.arguments import require
from chilopod.engine.contract import Traits
from chilopod.errors import ParameterError
from chilopod.robot import Robot

_MAGIC = b"chilopod walk 2\n"
_DIGEST = 32  # bytes
_ALLOWED = "bytes that save() returned"


def pack(traits: Traits, robots: Sequence[Robot], settings: Mapping[str, Any], arrays: Mapping[str, Any]) -> bytes:
    """Pack the traits of the engine, the robots, settings of plain data (numbers, text, lists, None) and named arrays
    as bytes."""
    written = {id(robot): robot.to_toml() for robot in {id(robot): robot for robot in robots}.values()}
    distinct = list(dict.fromkeys(written.values()))
    header = {**_made_by(traits), "robots": distinct, "settings": settings}
    body = io.BytesIO()
    which = np.array([distinct.index(written[id(robot)]) for robot in robots])
    np.savez(body, header=np.array(json.dumps(header)), which=which, **arrays)
    content = body.getvalue()
    return _MAGIC + hashlib.sha256(content).digest() + content


def unpack(traits: Traits, saved: object) -> tuple[list[Robot], dict[str, Any], dict[str, Any]]:
    """Return robots, settings and arrays from bytes of :func:`pack`; ParameterError for other bytes, damaged ones, or
    those of another engine or version."""
    if not isinstance(saved, bytes | bytearray | memoryview):
        raise ParameterError("must be a saved walk", field="saved", value=type(saved).__name__, allowed="bytes")
    body = bytes(saved)
    require(body.startswith(_MAGIC), "must be a saved walk", "saved", allowed=_ALLOWED)
    digest, content = body[len(_MAGIC) : len(_MAGIC) + _DIGEST], body[len(_MAGIC) + _DIGEST :]
    require(hashlib.sha256(content).digest() == digest, "is damaged", "saved", allowed=f"all {_ALLOWED}")
    with read_back("cannot be read"):
        with np.load(io.BytesIO(content), allow_pickle=False) as read:
            arrays: dict[str, Any] = dict(read)
        header = json.loads(str(arrays.pop("header")))
        distinct, which = header["robots"], arrays.pop("which")
        for name, here in _made_by(traits).items():
            found = header.get(name)
            require(found == here, f"was saved with another {name}", "saved", found, here)
        robots = [Robot.from_toml(text) for text in distinct]
        return [robots[i] for i in which], header["settings"], arrays


def part(arrays: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Arrays whose names begin with a prefix, by the rest of their names."""
    return {name.removeprefix(prefix): each for name, each in arrays.items() if name.startswith(prefix)}


@contextmanager
def read_back(problem: str = "does not fit together") -> Iterator[None]:
    """Turn errors from missing or misshapen parts of a saved walk into ParameterErrors."""
    try:
        yield
    except ParameterError:
        raise
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, OSError, zipfile.BadZipFile) as error:
        raise ParameterError(f"{problem} ({error})", field="saved", allowed=_ALLOWED) from None


@cache
def _made_by(traits: Traits) -> dict[str, str]:
    return {"engine": traits.name, "chilopod": version("chilopod"), "version": traits.version}
