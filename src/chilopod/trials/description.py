"""Contents of a trial, as plain data: its identity is derived from them."""

from __future__ import annotations

import dataclasses
import enum
import hashlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cached_property, lru_cache
from operator import attrgetter
from typing import Any

import numpy as np

from chilopod.engine.named import PARTS, path_of
from chilopod.errors import ParameterError
from chilopod.robot import Robot
from chilopod.trials.reach import Reach

_LARGEST = 2**63
DIGITS = 16  # of a digest of code
_described: ContextVar[dict[object, tuple[str, str]] | None] = ContextVar("described", default=None)


def plain(value: object, field: str) -> Any:
    """A number, text, None, enum, array, or a tuple or frozen dataclass of these, in the form of JSON, distinct for
    distinct values: classes by their path, dataclasses by the fields that count in comparisons. Raises ParameterError
    for anything else, with the field."""
    kind: Any = type(value)
    if isinstance(value, enum.Enum):
        return {"enum": path_of(kind), "name": value.name}
    if value is None or kind in (bool, float, str) or (type(value) is int and abs(value) < _LARGEST):
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
            "class": path_of(kind),
            "fields": {name: plain(getattr(value, name), f"{field}.{name}") for name in _counted(value)},
        }
    problem = "must be plain data, because its value names the trial"
    allowed = "numbers, text, None, enums, arrays, and tuples or frozen dataclasses of these"
    raise ParameterError(problem, field=field, value=kind.__name__, allowed=allowed)


def code_of(value: object) -> tuple[str, str]:
    """Digest of everything that the code of a controller can reach now, and the source of chance in it, if any; empty
    for controllers of chilopod. Raises UnknownKindError for an object that cannot be described."""
    parts: list[str] = []
    chances: list[str] = []
    for each in _parts(value):
        kind, beside = type(each), Reach()
        found, chance = _once(kind, kind.__module__, kind.__qualname__, (kind,))
        parts.append(found)
        chances.append(chance)
        for name in sorted(getattr(each, "__dict__", {}).keys() - _declared(each)):
            beside.see(vars(each)[name], f"{kind.__qualname__}.{name}")
            parts += [name, beside.digest]
        chances.append(beside.chance)
    digest = hashlib.sha256(repr(parts).encode()).hexdigest()[:DIGITS] if any(parts) else ""
    return digest, next(filter(None, chances), "")


def engine_code_of(engine: str) -> str:
    """Digest of everything that the code of a user's engine, by its name, can reach now; empty for engines of chilopod.
    Raises UnknownKindError for an object that cannot be described."""
    module, _, name = engine.partition(":")
    if not name:
        return ""
    found: Any = attrgetter(name)(sys.modules[module])
    # A module may be an engine: no class leads to its functions.
    return _once(engine, module, name, (sys.modules[module], found, *(getattr(found, each) for each in PARTS)))[0]


def _once(key: object, module: str, path: str, values: tuple[object, ...]) -> tuple[str, str]:
    top, known = module.partition(".")[0], _described.get()
    if top == "chilopod":
        return "", ""
    known = {} if known is None else known
    if key not in known:
        reach = Reach(top)
        for each in values:
            reach.see(each, path)
        known[key] = reach.digest, reach.chance
    return known[key]


@contextmanager
def meanwhile_unchanged() -> Iterator[None]:
    """Describe each class only once within the block, in which classes must not change."""
    token = _described.set({})
    try:
        yield
    finally:
        _described.reset(token)


def classes_in(value: object) -> Iterator[type]:
    """All user classes in an argument of :func:`plain`."""
    return (type(each) for each in _parts(value))


def is_ours(kind: type) -> bool:
    """True if a class is part of chilopod."""
    return kind.__module__.partition(".")[0] == "chilopod"


def is_findable(kind: type) -> bool:
    """True if another process can import a class by its name, which excludes notebooks and scripts."""
    found: Any = sys.modules.get(kind.__module__)
    for part in kind.__qualname__.split("."):
        found = getattr(found, part, None)
    return found is kind and kind.__module__ != "__main__"


@lru_cache(maxsize=4096)
def file_text(robot: Robot) -> str:
    """Text of the robot file, cached for repeats."""
    return robot.to_toml()


@lru_cache(maxsize=4096)
def robot_text(robot: Robot) -> str:
    """Text of a robot file with everything that determines a walk, without name and provenance."""
    return robot.with_(name="robot", provenance={}).to_toml()


def _parts(value: object) -> Iterator[Any]:
    """Enums and dataclasses in an argument of :func:`plain`."""
    if isinstance(value, enum.Enum):
        yield value
    elif isinstance(value, tuple):
        for each in value:
            yield from _parts(each)
    elif dataclasses.is_dataclass(value):
        yield value
        for name in _counted(value):
            yield from _parts(getattr(value, name))


def _declared(value: Any) -> set[str]:
    """Attributes of an object that its class fully defines."""
    if isinstance(value, enum.Enum):
        return set(vars(value))
    declared = {each.name for each in dataclasses.fields(value)}
    for kind in type(value).__mro__:
        declared.update(name for name, part in vars(kind).items() if isinstance(part, cached_property))
    return declared


def _counted(value: Any) -> list[str]:
    return [each.name for each in dataclasses.fields(value) if each.compare]
