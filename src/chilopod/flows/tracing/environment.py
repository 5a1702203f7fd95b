"""Dependencies of a Python function besides its arguments: sorted by kind, and replaced by traced versions.

The floats among a function's arguments, defaults, closure and globals become parameters of the tape; whole numbers,
strings and the code itself are part of its cache key: a family of lambdas is traced once, a changed global anew.
"""

from __future__ import annotations

import builtins
import functools
import sys
import types
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from chilopod.flows.tracing.standins import stand_in
from chilopod.flows.tracing.traced import as_traced

_PLAIN = (int, bool, str, bytes, complex, type(None), np.integer, np.bool_)
_FLOAT, _ROW = (float, np.floating), (tuple, list)  # np.float64 is a float
_FUNCTIONS = types.FunctionType, type(np.dot)
_OUTSIDE = ("numpy", "scipy", "math", "builtins", "numba")


class Opaque(Exception):
    """A function holds an object whose contents may change unnoticed, so its tape cannot be cached."""


def python_function(value: Any) -> Any:
    """Python function behind a compiled one; any other value is returned unchanged."""
    inner = getattr(value, "py_func", None)
    return inner if isinstance(inner, types.FunctionType) else value


def _outside(name: str | None) -> bool:
    return (name or "").partition(".")[0] in _OUTSIDE


def _own(value: Any) -> bool:
    return isinstance(value, types.FunctionType) and not _outside(value.__module__)


def _constant(value: Any) -> bool:
    """True for modules, types and functions of the libraries, which never change. The attributes of a user's modules
    and classes may; so may an object that is called like a function, or that a bound method belongs to."""
    if isinstance(value, types.ModuleType):
        return _outside(value.__name__)
    if isinstance(value, types.BuiltinFunctionType):
        return value.__self__ is None or isinstance(value.__self__, types.ModuleType)
    if isinstance(value, np.ufunc):  # others may be made of a user's function
        homes = (np, sys.modules.get("scipy.special"))
        return any(getattr(home, value.__name__, None) is value for home in homes)
    return isinstance(value, (type, *_FUNCTIONS)) and _outside(value.__module__)


@functools.lru_cache(maxsize=1024)
def _names(code: types.CodeType) -> tuple[str, ...]:
    """Names that code may look up among the globals, in order."""
    names = dict.fromkeys(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names.update(dict.fromkeys(_names(constant)))
    return tuple(names)


def _parts(function: types.FunctionType) -> tuple[Any, ...]:
    """Closure, defaults and globals of a function."""
    contents = [cell.cell_contents for cell in function.__closure__ or ()]
    outer = function.__globals__
    used = {name: outer[name] for name in _names(function.__code__) if name in outer}
    return contents, function.__defaults__, function.__kwdefaults__, used


def describe(value: Any, floats: list[float], seen: dict[int, int]) -> Any:
    """A hashable description of a value; all its floats are appended to a list. Raises Opaque for unknown kinds."""
    if isinstance(value, _FLOAT):
        floats.append(float(value))
        return "f"
    if isinstance(value, _PLAIN):
        return type(value).__name__, value
    value = python_function(value)
    if _constant(value):
        return "id", id(value)
    if isinstance(value, np.ndarray):
        if value.dtype.kind == "f":
            floats += value.ravel().tolist()
            return "a", value.shape
        if value.dtype.kind == "O":
            raise Opaque
        return "b", value.shape, value.dtype.str, value.tobytes()
    if isinstance(value, _ROW):
        return type(value).__name__, tuple(describe(part, floats, seen) for part in value)
    if isinstance(value, dict):
        return "d", tuple((describe(key, floats, seen), describe(part, floats, seen)) for key, part in value.items())
    if _own(value):
        if id(value) in seen:
            return "again", seen[id(value)]
        seen[id(value)] = len(seen)
        return "function", value.__code__, *(describe(part, floats, seen) for part in _parts(value))
    if isinstance(value, functools.partial):
        return "partial", *(describe(part, floats, seen) for part in (value.func, value.args, value.keywords))
    raise Opaque


def rebuild(value: Any, source: Iterator[Any] | None, seen: dict[int, Any]) -> Any:
    """The value with floats from an iterator, as in :func:`describe`, if given; numpy and math for traced ones."""
    value = python_function(value)
    if isinstance(value, _FLOAT):
        return value if source is None else next(source)
    if isinstance(value, _PLAIN):
        return value
    if isinstance(value, np.ndarray):
        if value.dtype.kind != "f" or source is None:
            return value
        return as_traced([next(source) for _ in range(value.size)]).reshape(value.shape)
    if isinstance(value, _ROW):
        return type(value)([rebuild(part, source, seen) for part in value])
    if isinstance(value, dict):
        return {rebuild(key, source, seen): rebuild(part, source, seen) for key, part in value.items()}
    if _own(value):
        return _rebuilt_function(value, source, seen)
    if isinstance(value, functools.partial):
        function, args, keywords = (rebuild(part, source, seen) for part in (value.func, value.args, value.keywords))
        return functools.partial(function, *args, **keywords)
    # A method, or an object that is called like a function.
    bound = isinstance(value, types.MethodType)
    call = python_function(value.__func__) if bound else vars(type(value)).get("__call__")
    if _own(call):
        return types.MethodType(_rebuilt_function(call, None, seen), value.__self__ if bound else value)
    return stand_in(value)


def _rebuilt_function(
    value: types.FunctionType, source: Iterator[Any] | None, seen: dict[int, Any]
) -> Callable[..., Any]:
    if id(value) in seen:
        return seen[id(value)]
    outer: dict[str, Any] = {"__builtins__": _BUILTINS, "__name__": value.__module__}
    cells = tuple(types.CellType() for _ in value.__closure__ or ())
    function = types.FunctionType(value.__code__, outer, value.__name__, None, cells)
    seen[id(value)] = function
    parts = (rebuild(part, source, seen) for part in _parts(value))
    contents, function.__defaults__, function.__kwdefaults__, names = parts
    for cell, content in zip(cells, contents, strict=True):
        cell.cell_contents = content
    outer.update(names)
    return function


def _import(name: str, *args: Any, **options: Any) -> Any:
    return stand_in(builtins.__import__(name, *args, **options))


_BUILTINS = {name: stand_in(value) for name, value in vars(builtins).items()} | {"__import__": _import}
