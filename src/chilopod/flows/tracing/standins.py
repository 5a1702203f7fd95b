"""Versions of numpy, math and builtins for traced numbers."""

from __future__ import annotations

import builtins
import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.traced import (
    REPLACED,
    SCALAR,
    Traced,
    TracedArray,
    Untraceable,
    as_traced,
    node_of,
    number_of,
    plain,
    wrapped,
)


def _where(condition: Any, above: Any, below: Any) -> Any:
    if not isinstance(condition, Traced):
        return above if condition else below
    graph = condition.graph
    code, operands = graph.nodes[condition.node]
    a, b = node_of(graph, above), node_of(graph, below)
    if code == ops.SELECT and graph.value(operands[1]) == 1.0 and graph.value(operands[2]) == 0.0:
        switch = operands[0]
    elif code == ops.SELECT and graph.value(operands[1]) == 0.0 and graph.value(operands[2]) == 1.0:
        switch, a, b = operands[0], b, a
    else:
        switch = graph.add(condition.node, graph.number(0.5), -1.0)
    return number_of(graph, graph.select(switch, a, b))


def _clip(value: Any, low: Any = None, high: Any = None, **_: Any) -> Any:
    if low is not None:
        value = np.maximum(as_traced(value), low)
    return value if high is None else np.minimum(as_traced(value), high)


def _where_arrays(condition: Any, *choices: Any) -> Any:
    if len(choices) != 2:
        raise Untraceable("it needs the places where an array is not zero")
    return wrapped(np.frompyfunc(_where, 3, 1)(*(plain(as_traced(value)) for value in (condition, *choices))))


def _solve(matrix: Any, right: Any) -> Any:
    """Gaussian elimination; a pivot of unknown size is taken from the diagonal."""
    if not (_has_traced(matrix) or _has_traced(right)):
        return np.linalg.solve(matrix, right)
    a, b = plain(as_traced(matrix)).copy(), plain(as_traced(right)).copy()
    n = a.shape[0]
    if a.shape != (n, n):
        raise Untraceable("it solves with a stack of matrices")

    def worth(value: Any) -> float:
        return -1.0 if isinstance(value, Traced) else abs(value)

    for column in range(n):
        rows = range(column, n)
        pivot = max(rows, key=lambda row: worth(a[row, column]))
        if any(isinstance(a[row, column], Traced) for row in rows):
            # The largest pivot is unknown while tracing: the diagonal one is used, which suits mass matrices.
            pivot = column if worth(a[column, column]) != 0.0 else pivot
            if worth(a[pivot, column]) == 0.0:
                pivot = next(row for row in rows if isinstance(a[row, column], Traced))
        elif worth(a[pivot, column]) == 0.0:
            raise Untraceable("it solves with a singular matrix")
        a[[column, pivot]], b[[column, pivot]] = a[[pivot, column]], b[[pivot, column]]
        for row in range(column + 1, n):
            if worth(a[row, column]) == 0.0:
                continue
            factor = a[row, column] / a[column, column]
            a[row, column:] = a[row, column:] - factor * a[column, column:]
            b[row] = b[row] - factor * b[column]
    for row in range(n - 1, -1, -1):
        for column in range(row + 1, n):
            b[row] = b[row] - a[row, column] * b[column]
        b[row] = b[row] / a[row, row]
    return b.view(TracedArray)


def _has_traced(value: Any) -> bool:
    if isinstance(value, Traced):
        return True
    if isinstance(value, np.ndarray):
        return value.dtype == object
    return isinstance(value, list | tuple) and any(_has_traced(part) for part in value)


def _array(value: Any, *args: Any, **options: Any) -> Any:
    """Traced copies of float arrays, which may be written into later; arrays of whole numbers are indices."""
    if _has_traced(value):
        return as_traced(value).copy()
    result = np.array(value, *args, **{key: part for key, part in options.items() if key != "like"})
    return as_traced(result) if result.dtype.kind == "f" and result.ndim == 1 else result


def _blank(make: Callable[..., Any]) -> Callable[..., Any]:
    def shaped(*args: Any, **options: Any) -> Any:
        if any(_has_traced(value) for value in args[1:]) or _has_traced(options.get("fill_value")):
            shape, value = args[0], options.get("fill_value", args[1] if len(args) > 1 else 0.0)
            result = np.empty(np.shape(shape) if make is np.full_like else shape, dtype=object)
            result[...] = value
            return result.view(TracedArray)
        options = {key: value for key, value in options.items() if not _means_object(value)}
        args = tuple(_numeric(value) for value in args if not _means_object(value))
        result = make(*args, **options)
        return as_traced(result) if result.dtype.kind == "f" else result

    return shaped


def _means_object(value: Any) -> bool:
    """True for the type of traced arrays."""
    return isinstance(value, type | np.dtype) and value in (object, np.dtype(object))


def _numeric(value: Any) -> Any:
    return np.zeros(value.shape) if isinstance(value, TracedArray) else value


def _norm(value: Any, ord: Any = None, axis: Any = None, keepdims: Any = False) -> Any:
    if ord not in (None, 2) or (axis is None and np.ndim(value) != 1 and ord is not None):
        raise Untraceable("it takes a norm other than Euclid's")
    return np.sqrt(np.add.reduce(as_traced(value) ** 2, axis=axis, keepdims=keepdims))


def _mean(value: Any, axis: Any = None, keepdims: Any = False) -> Any:
    array = as_traced(value)
    return np.add.reduce(array, axis=axis, keepdims=keepdims) / (array.size if axis is None else array.shape[axis])


def _extreme(ufunc: np.ufunc) -> Callable[..., Any]:
    return lambda value, axis=None, keepdims=False: ufunc.reduce(as_traced(value), axis=axis, keepdims=keepdims)


REPLACED |= {
    np.where: _where_arrays,
    np.clip: _clip,
    np.linalg.solve: _solve,
    np.linalg.norm: _norm,
    np.real: lambda value: value,
    np.imag: lambda value: np.zeros(np.shape(value)),
    np.mean: _mean,
    np.max: _extreme(np.maximum),
    np.amax: _extreme(np.maximum),
    np.min: _extreme(np.minimum),
    np.amin: _extreme(np.minimum),
    np.zeros_like: _blank(np.zeros_like),
    np.ones_like: _blank(np.ones_like),
    np.empty_like: _blank(np.zeros_like),
    np.full_like: _blank(np.full_like),
    np.iscomplexobj: lambda value: False,
    np.isrealobj: lambda value: True,
    np.dot: lambda a, b: wrapped(np.dot(plain(as_traced(a)), plain(as_traced(b)))),
}

_SAME_NAME = (
    *("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "expm1", "log1p", "log2", "log10", "exp2"),
    *("asin", "acos", "atan", "atan2", "pow", "fabs", "cbrt", "floor", "ceil", "trunc", "hypot", "copysign"),
    *("radians", "degrees"),
)
"""Functions with the same name in math and numpy."""


def _instead() -> dict[int, Any]:
    """Stand-ins, by identity, for functions that do not accept traced numbers."""
    pairs: list[tuple[Any, Any]] = [
        (np.array, _array),
        (np.asarray, lambda value, *a, **o: value if isinstance(value, TracedArray) else _array(value, *a, **o)),
        (np.ascontiguousarray, lambda value, *a, **o: _array(value)),
        (np.zeros, _blank(np.zeros)),
        (np.empty, _blank(np.zeros)),
        (np.ones, _blank(np.ones)),
        (np.full, _blank(np.full)),
        (np.eye, lambda *a, **o: as_traced(np.eye(*a, **o))),
        (np.identity, lambda *a, **o: as_traced(np.identity(*a, **o))),
        (np.float64, lambda value=0.0: value if _has_traced(value) else np.float64(value)),
        (builtins.float, lambda value=0.0: value if isinstance(value, Traced) else float(value)),
        (builtins.max, _most(builtins.max, np.maximum)),
        (builtins.min, _most(builtins.min, np.minimum)),
        (math.fsum, lambda values: sum(values)),
        (math.fmod, lambda a, b: a - b * np.trunc(a / b)),
    ]
    pairs += [(getattr(math, name), getattr(np, name)) for name in _SAME_NAME]
    return {id(real): own for real, own in [*REPLACED.items(), *pairs]}


def _most(plain: Callable[..., Any], ufunc: np.ufunc) -> Callable[..., Any]:
    def most(*values: Any, **options: Any) -> Any:
        flat = list(values[0]) if len(values) == 1 else list(values)
        return functools.reduce(SCALAR[ufunc.__name__], flat) if _has_traced(flat) else plain(flat, **options)

    return most


class Module:
    """A module with functions for traced numbers."""

    def __init__(self, module: Any) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        return stand_in(getattr(self._module, name))


_INSTEAD = _instead()
_MODULES = {"numpy", "math", "numpy.linalg"}


def stand_in(value: Any) -> Any:
    """Stand-in of a module, function or class while tracing; most stand for themselves."""
    if getattr(value, "__name__", None) in _MODULES and isinstance(value, type(math)):
        return Module(value)
    return _INSTEAD.get(id(value), value)
