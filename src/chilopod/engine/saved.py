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

from chilopod.engine.contract import Traits
from chilopod.errors import ParameterError
from chilopod.robot import Robot

_MAGIC = b"chilopod walk 2\n"
_DIGEST = 32  # bytes


def pack(traits: Traits, robots: Sequence[Robot], settings: Mapping[str, Any], arrays: Mapping[str, Any]) -> bytes:
    """Pack the traits of the engine, the robots, settings of plain data (numbers, text, lists, None) and named arrays
    as bytes."""
    written = {id(robot): robot.to_toml() for robot in {id(robot): robot for robot in robots}.values()}
    texts = [written[id(robot)] for robot in robots]
    distinct = list(dict.fromkeys(texts))
    header = {**_made_by(traits), "robots": distinct, "settings": settings}
    body = io.BytesIO()
    which = np.array([distinct.index(text) for text in texts])
    np.savez(body, header=np.array(json.dumps(header)), which=which, **arrays)
    content = body.getvalue()
    return _MAGIC + hashlib.sha256(content).digest() + content


def unpack(traits: Traits, saved: object) -> tuple[list[Robot], dict[str, Any], dict[str, Any]]:
    """Return robots, settings and arrays from bytes of :func:`pack`; ParameterError for other bytes, damaged ones, or
    those of another engine or version."""
    if not isinstance(saved, bytes | bytearray | memoryview):
        raise ParameterError("must be a saved walk", field="saved", value=type(saved).__name__, allowed="bytes")
    saved = bytes(saved)
    content = saved[len(_MAGIC) + _DIGEST :]
    if saved[: len(_MAGIC)] != _MAGIC:
        raise ParameterError("must be a saved walk", field="saved", allowed="bytes that save() returned")
    if hashlib.sha256(content).digest() != saved[len(_MAGIC) : len(_MAGIC) + _DIGEST]:
        raise ParameterError("is damaged", field="saved", allowed="all bytes that save() returned")
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as read:
            arrays: dict[str, Any] = dict(read)
        header = json.loads(str(arrays.pop("header")))
        made_by = {name: header.get(name) for name in _made_by(traits)}
        distinct, which = header["robots"], arrays.pop("which")
        for name, here in _made_by(traits).items():
            if made_by[name] != here:
                raise ParameterError(f"was saved with another {name}", field="saved", value=made_by[name], allowed=here)
        robots = [Robot.from_toml(text) for text in distinct]
        return [robots[i] for i in which], header["settings"], arrays
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, OSError, zipfile.BadZipFile) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(f"cannot be read ({error})", field="saved", allowed="bytes that save() returned") from None


def part(arrays: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Arrays whose names begin with a prefix, by the rest of their names."""
    return {name.removeprefix(prefix): each for name, each in arrays.items() if name.startswith(prefix)}


@contextmanager
def read_back() -> Iterator[None]:
    """Turn errors from missing or misshapen parts of an unpacked walk into ParameterErrors."""
    try:
        yield
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(
            f"does not fit together ({error})", field="saved", allowed="bytes that save() returned"
        ) from None


@cache
def _made_by(traits: Traits) -> dict[str, str]:
    return {"engine": traits.name, "chilopod": version("chilopod"), "version": traits.version}
