"""What a trial is made of, as plain data: what its identity is derived from."""

from __future__ import annotations

import dataclasses
import enum
import hashlib
import inspect
import sys
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from chilopod.engine.named import path_of
from chilopod.errors import ParameterError
from chilopod.robot import Robot

_DIGITS = 16


def plain(value: object, field: str) -> Any:
    """A value as numbers, text, lists and tables, different for different values.

    Parameters
    ----------
    value
        Number, text, None, enum, array, or a list, tuple, mapping or dataclass of these. Of a dataclass its class, the
        text of that, and the fields that count in comparisons.
    field
        What to call it where it is refused.

    Raises
    ------
    ParameterError
        If it is, or has, anything else, naming the field.
    """
    if isinstance(value, enum.Enum):
        return {"enum": path_of(value), "name": value.name}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic | np.ndarray) and value.dtype.kind in "biufU":
        return value.item() if isinstance(value, np.generic) else {"array": value.tolist(), "dtype": str(value.dtype)}
    if isinstance(value, list | tuple):
        return [plain(each, f"{field}[{index}]") for index, each in enumerate(value)]
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {key: plain(each, f"{field}[{key!r}]") for key, each in value.items()}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        own = [each.name for each in dataclasses.fields(value) if each.compare]
        fields = {name: plain(getattr(value, name), f"{field}.{name}") for name in own}
        path, code = path_of(value), _code_of(type(value))
        # Classes that a function makes may differ in what it had at hand, and nowhere else.
        return {"class": path, "code": code if is_findable(path) else f"{code} {id(type(value)):x}", "fields": fields}
    raise ParameterError(
        "is no plain data, so nobody could tell trials apart",
        field=field,
        value=type(value).__name__,
        allowed="numbers, text, None, enums, arrays, and tuples or dataclasses of these",
    )


def is_findable(path: str) -> bool:
    """Whether another process can find what has this path: not in a notebook, a script or a function."""
    return not path.startswith("__main__:") and "<locals>" not in path


def classes_in(described: Any) -> list[str]:
    """Paths of all classes in what :func:`plain` gave."""
    if isinstance(described, list):
        return [path for each in described for path in classes_in(each)]
    if not isinstance(described, dict):
        return []
    own = [described[name] for name in ("class", "enum") if isinstance(described.get(name), str)]
    return own + [path for each in described.values() for path in classes_in(each)]


@lru_cache(maxsize=4096)
def file_text(robot: Robot) -> str:
    """The robot file; of repeats it is written once."""
    return robot.to_toml()


@lru_cache(maxsize=4096)
def robot_text(robot: Robot) -> str:
    """A robot file that says all that makes a walk: what it is called and where its numbers come from does not."""
    return robot.with_(name="robot", provenance={}).to_toml()


@lru_cache(maxsize=256)
def _code_of(kind: type) -> str:
    """What tells the text of somebody's class from what it was before an edit; empty for our own, and without text.

    Our own have :data:`chilopod.trials.trial.RECORD_VERSION`.
    """
    texts = []
    for each in kind.__mro__:
        package = each.__module__.partition(".")[0]
        if package == "chilopod" or package in sys.stdlib_module_names - {"__main__"}:
            continue
        try:
            texts.append(inspect.getsource(each))
        except (OSError, TypeError):
            return ""
    return hashlib.sha256("".join(texts).encode()).hexdigest()[:_DIGITS] if texts else ""
