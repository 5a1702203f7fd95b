"""What a trial is made of, as plain data: what its identity is derived from."""

from __future__ import annotations

import dataclasses
import enum
import functools
import hashlib
import sys
import types
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from chilopod.engine.named import path_of
from chilopod.errors import ParameterError
from chilopod.robot import Robot

_DIGITS = 16
_LARGEST = 2**63
# What every class has, or a dataclass is given: its fields are described one by one.
_GIVEN = frozenset(
    f"__{name}__"
    for name in (
        *("module", "qualname", "doc", "dict", "weakref", "slots", "firstlineno", "static_attributes"),
        *("annotations", "annotations_cache", "annotate_func", "dataclass_fields", "dataclass_params", "match_args"),
        *("init", "repr", "eq", "hash", "setattr", "delattr", "replace", "getstate", "setstate"),
    )
)


def plain(value: object, field: str) -> Any:
    """A value as numbers, text, lists and tables, different for different values.

    Parameters
    ----------
    value
        Number, text, None, enum, array, or a tuple or frozen dataclass of these. Of classes of one's own their path and
        a digest of their code as it is now; of a dataclass the fields that count in comparisons.
    field
        What to call it where it is refused.

    Raises
    ------
    ParameterError
        If it is, or has, anything else, naming the field.
    """
    kind: Any = type(value)
    if isinstance(value, enum.Enum):
        return {"enum": _class(kind), "name": value.name}
    if (
        value is None
        or kind in (bool, float, str)
        or (isinstance(value, int) and kind is int and abs(value) < _LARGEST)
    ):
        return value
    if isinstance(value, np.generic) or kind is np.ndarray:
        array = np.asarray(value)
        if array.dtype.kind in "biu" or (array.dtype.kind == "f" and array.dtype.itemsize <= 8):
            shape = None if isinstance(value, np.generic) else list(array.shape)
            return {"numpy": array.tolist(), "dtype": str(array.dtype), "shape": shape}
    if isinstance(value, tuple) and kind is tuple:
        return {"tuple": [plain(each, f"{field}[{index}]") for index, each in enumerate(value)]}
    if dataclasses.is_dataclass(value) and not isinstance(value, type) and kind.__dataclass_params__.frozen:
        return {
            "class": _class(kind),
            "fields": {name: plain(getattr(value, name), f"{field}.{name}") for name in _counted(value)},
        }
    raise ParameterError(
        "is no plain data, so nobody could tell trials apart",
        field=field,
        value=kind.__name__,
        allowed="numbers, text, None, enums, arrays, and tuples or frozen dataclasses of these",
    )


def classes_in(value: object) -> Iterator[type]:
    """All classes of one's own in what :func:`plain` takes."""
    if isinstance(value, enum.Enum):
        yield type(value)
    elif isinstance(value, tuple):
        for each in value:
            yield from classes_in(each)
    elif dataclasses.is_dataclass(value):
        yield type(value)
        for name in _counted(value):
            yield from classes_in(getattr(value, name))


def is_findable(kind: type) -> bool:
    """Whether another process can find a class: what its module has by its name, not in a notebook or a script."""
    found: Any = sys.modules.get(kind.__module__)
    for part in kind.__qualname__.split("."):
        found = getattr(found, part, None)
    return found is kind and kind.__module__ != "__main__"


@lru_cache(maxsize=4096)
def file_text(robot: Robot) -> str:
    """The robot file; of repeats it is written once."""
    return robot.to_toml()


@lru_cache(maxsize=4096)
def robot_text(robot: Robot) -> str:
    """A robot file that says all that makes a walk: what it is called and where its numbers come from does not."""
    return robot.with_(name="robot", provenance={}).to_toml()


def _counted(value: Any) -> list[str]:
    return [each.name for each in dataclasses.fields(value) if each.compare]


@lru_cache(maxsize=256)
def _class(kind: Any) -> str:
    """Path and code of a class; of one that others cannot find also which of this process it is."""
    own = "" if is_findable(kind) else f" {id(kind):x}"
    return f"{path_of(kind)} {_code_of(kind)}{own}"


def _code_of(kind: type) -> str:
    """A digest of what the methods and constants of a class are now, whatever its file says; empty for our own.

    Our own have :data:`chilopod.trials.trial.RECORD_VERSION`.
    """
    told = []
    for each in kind.__mro__:
        package = each.__module__.partition(".")[0]
        if package == "chilopod" or (package in sys.stdlib_module_names - {"__main__"} and is_findable(each)):
            continue
        told.append([(name, _told(part)) for name, part in sorted(vars(each).items()) if name not in _GIVEN])
    return hashlib.sha256(repr(told).encode()).hexdigest()[:_DIGITS] if told else ""


def _told(part: Any) -> object:
    """What tells a method or a constant from another, the same in every process."""
    if isinstance(part, staticmethod | classmethod):
        return type(part).__name__, _told(part.__func__)
    if isinstance(part, property):
        return "property", _told(part.fget)
    if isinstance(part, functools.cached_property):
        return "property", _told(part.func)
    if isinstance(part, enum.Enum):
        return part.name, _told(part.value)
    part = getattr(part, "py_func", part)  # as numba keeps it
    if isinstance(part, types.FunctionType):
        held = [_told(cell.cell_contents) for cell in part.__closure__ or ()]
        defaults = [_told(each) for each in part.__defaults__ or ()]
        named = [(name, _told(each)) for name, each in sorted((part.__kwdefaults__ or {}).items())]
        return "function", _told(part.__code__), defaults, named, held
    if isinstance(part, types.CodeType):
        return part.co_code.hex(), part.co_names, part.co_varnames, [_told(each) for each in part.co_consts]
    if isinstance(part, frozenset | set):
        return "set", sorted(repr(_told(each)) for each in part)
    if isinstance(part, type):
        return "class", path_of(part)
    try:
        return plain(part, "")
    except ParameterError:
        return path_of(type(part))
