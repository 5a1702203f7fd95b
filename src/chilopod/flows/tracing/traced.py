"""Numbers and arrays that record operations, and versions of numpy, math and builtins for them.

A function that is called with a :class:`Traced` number, or a :class:`TracedArray` of these and plain numbers, records
its operations in a :class:`chilopod.flows.tracing.graph.Graph`: numpy asks both for its functions, of which the ufuncs
of ``SCALAR`` are applied entry by entry, those in ``REPLACED`` have their own version, and the others work on arrays of
objects. Functions that never ask their arguments, as ``np.array`` and those of math, have stand-ins (:func:`stand_in`),
to be put into the globals of the function. A use of the value of a traced number (a branch, an index, a foreign
library) raises :class:`Untraceable`.
"""

from __future__ import annotations

import builtins
import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.graph import BUILDS, Graph


class Untraceable(Exception):
    """A right-hand side is not a fixed sequence of known operations; the message names the obstacle."""


class _Recording:
    __slots__ = ()

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        out = options.pop("out", None)
        options = {key: value for key, value in options.items() if key not in ("dtype", "casting", "subok", "order")}
        if options.pop("where", True) is not True:
            raise Untraceable(f"it calls numpy.{ufunc.__name__} with where=")
        if out is not None and isinstance(out[0], Traced):
            out = None  # as in x += 1: the name now refers to another number
        operands = [plain(value if isinstance(value, np.ndarray) else as_traced(value)) for value in inputs]
        if ufunc is np.matmul and method == "__call__":
            result = np.matmul(*operands)
        elif ufunc.__name__ not in SCALAR:
            raise Untraceable(f"it calls numpy.{ufunc.__name__}")
        else:
            result = getattr(_ENTRY_BY_ENTRY[ufunc.__name__], method)(*operands, **options)
        if out is not None:
            if not isinstance(out[0], TracedArray):
                raise Untraceable("it writes into an array of plain numbers")
            plain(out[0])[...] = result
            return out[0]
        return wrapped(result)

    def __array_function__(self, function: Any, kinds: Any, args: Any, options: Any) -> Any:
        if function in REPLACED:
            return REPLACED[function](*args, **options)

        def bare(value: Any) -> Any:
            if isinstance(value, tuple | list):
                return type(value)(bare(part) for part in value)
            return plain(as_traced(value)) if isinstance(value, Traced) else plain(value)

        result = function(*bare(args), **{key: bare(value) for key, value in options.items()})
        return type(result)(wrapped(part) for part in result) if isinstance(result, tuple | list) else wrapped(result)


class Traced(_Recording, np.lib.mixins.NDArrayOperatorsMixin):
    """One number under tracing: a node of a graph, and an array without dimensions."""

    __slots__ = ("graph", "node")
    ndim = 0
    size = 1
    shape = ()
    dtype = np.dtype(np.float64)
    imag = 0.0

    def __init__(self, graph: Graph, node: int) -> None:
        self.graph = graph
        self.node = node

    def _value(self, *_: Any) -> Any:
        raise Untraceable("it needs the value of a number: a branch, an index, or a function of another library")

    __bool__ = __float__ = __int__ = __index__ = __complex__ = __hash__ = __round__ = _value
    # Equal only to itself, for tests that exclude the one state where a formula has a gap.
    __eq__ = object.__eq__
    __ne__ = object.__ne__

    def __floor__(self) -> Any:
        return np.floor(self)

    def __ceil__(self) -> Any:
        return np.ceil(self)

    def _itself(self) -> Traced:
        return self

    real = property(_itself)
    conjugate = copy = item = _itself


def node_of(graph: Graph, value: Any) -> int:
    """The node of a traced or plain real number."""
    if isinstance(value, Traced):
        return value.node
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return node_of(graph, value.item())
    if isinstance(value, complex | np.complexfloating):
        if value.imag != 0.0:
            raise Untraceable("it computes with complex numbers")
        value = value.real
    if not isinstance(value, int | float | bool | np.floating | np.integer | np.bool_):
        raise Untraceable(f"it computes with a {type(value).__name__}")
    return graph.number(float(value))


def number_of(graph: Graph, node: int) -> Any:
    """A node as a traced number, or as a plain one if it is known."""
    value = graph.value(node)
    return Traced(graph, node) if value is None else value


def _scalar(name: str, build: Callable[..., int]) -> Callable[..., Any]:
    def apply(*values: Any) -> Any:
        graph = next((value.graph for value in values if isinstance(value, Traced)), None)
        if graph is None:
            return getattr(np, name)(*values)
        return number_of(graph, build(graph, *(node_of(graph, value) for value in values)))

    return apply


SCALAR: dict[str, Callable[..., Any]] = {name: _scalar(name, build) for name, build in BUILDS.items()}
"""Functions of single numbers, traced or plain, by the name of their ufunc."""

_ENTRY_BY_ENTRY = {name: np.frompyfunc(apply, getattr(np, name).nin, 1) for name, apply in SCALAR.items()}


def _replaced(name: str) -> Any:
    return lambda self, *args, **options: REPLACED[getattr(np, name)](self, *args, **options)


class TracedArray(_Recording, np.ndarray[Any, np.dtype[Any]]):
    """An array of traced and plain numbers."""

    real = property(lambda self: self)
    imag = property(lambda self: np.zeros(self.shape))

    def astype(self, *_: Any, **__: Any) -> Any:
        return self.copy()

    max, min, mean, clip = map(_replaced, ("max", "min", "mean", "clip"))


def as_traced(value: Any) -> Any:
    """An array-like as an array that may hold traced numbers."""
    if isinstance(value, TracedArray):
        return value
    return np.array(value, dtype=object).view(TracedArray)


def plain(value: Any) -> Any:
    """A traced array as an ordinary array of objects."""
    return value.view(np.ndarray) if isinstance(value, TracedArray) else value


def wrapped(value: Any) -> Any:
    """The inverse of :func:`plain`; an array without dimensions becomes its number."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        return value.view(TracedArray) if value.ndim else value[()]
    return value


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
    """Gaussian elimination."""
    if not (_has_traced(matrix) or _has_traced(right)):
        return np.linalg.solve(matrix, right)
    a, b = plain(as_traced(matrix)).copy(), plain(as_traced(right)).copy()
    n = a.shape[0]
    if a.shape != (n, n):
        raise Untraceable("it solves with a stack of matrices")
    for column in range(n):
        pivot = column + _pivot(a[column:, column])
        a[[column, pivot]], b[[column, pivot]] = a[[pivot, column]], b[[pivot, column]]
        for row in range(column + 1, n):
            if a[row, column] != 0.0:  # or a traced number
                factor = a[row, column] / a[column, column]
                a[row, column:] = a[row, column:] - factor * a[column, column:]
                b[row] = b[row] - factor * b[column]
    for row in range(n - 1, -1, -1):
        for column in range(row + 1, n):
            b[row] = b[row] - a[row, column] * b[column]
        b[row] = b[row] / a[row, row]
    return b.view(TracedArray)


def _pivot(column: Any) -> int:
    """Place of the largest number in a column, or of the first where it is not zero and the largest is unknown while
    tracing, which suits mass matrices."""
    sizes = [-1.0 if isinstance(value, Traced) else abs(value) for value in column]
    if -1.0 in sizes and sizes[0] != 0.0:
        return 0
    if max(sizes) != 0.0:
        return sizes.index(max(sizes))
    if -1.0 not in sizes:
        raise Untraceable("it solves with a singular matrix")
    return sizes.index(-1.0)


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
    args, options = _typed(args, {key: part for key, part in options.items() if key != "like"})
    result = np.array(value, *args, **options)
    return as_traced(result) if result.dtype.kind == "f" and result.ndim == 1 else result


def _blank(make: Callable[..., Any]) -> Callable[..., Any]:
    def shaped(*args: Any, **options: Any) -> Any:
        args, options = _typed(args, options)
        if any(_has_traced(value) for value in args[1:]) or _has_traced(options.get("fill_value")):
            shape, value = args[0], options.get("fill_value", args[1] if len(args) > 1 else 0.0)
            result = np.empty(np.shape(shape) if make is np.full_like else shape, dtype=object)
            result[...] = value
            return result.view(TracedArray)
        options = {key: value for key, value in options.items() if not _means_object(value)}
        known = [value for value in args if not _means_object(value)]
        result = make(*(np.zeros(each.shape) if isinstance(each, TracedArray) else each for each in known), **options)
        return as_traced(result) if result.dtype.kind == "f" else result

    return shaped


def _typed(args: tuple[Any, ...], options: dict[str, Any]) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """Arguments with the type of floats in place of its stand-ins."""

    def real(value: Any) -> Any:
        return builtins.float if value is _float or value is _float64 else value

    return tuple(map(real, args)), {key: real(value) for key, value in options.items()}


def _float(value: Any = 0.0) -> Any:
    return value if isinstance(value, Traced) else float(value)


def _float64(value: Any = 0.0) -> Any:
    return value if _has_traced(value) else np.float64(value)


def _means_object(value: Any) -> bool:
    """True for the type of traced arrays."""
    return isinstance(value, type | np.dtype) and value in (object, np.dtype(object))


def _norm(value: Any, ord: Any = None, axis: Any = None, keepdims: Any = False) -> Any:
    if ord not in (None, 2) or (axis is None and np.ndim(value) != 1 and ord is not None):
        raise Untraceable("it takes a norm other than Euclid's")
    return np.sqrt(np.add.reduce(as_traced(value) ** 2, axis=axis, keepdims=keepdims))


def _mean(value: Any, axis: Any = None, keepdims: Any = False) -> Any:
    array = as_traced(value)
    return np.add.reduce(array, axis=axis, keepdims=keepdims) / (array.size if axis is None else array.shape[axis])


def _extreme(ufunc: np.ufunc) -> Callable[..., Any]:
    return lambda value, axis=None, keepdims=False: ufunc.reduce(as_traced(value), axis=axis, keepdims=keepdims)


REPLACED: dict[Any, Callable[..., Any]] = {
    np.where: _where_arrays,
    np.clip: _clip,
    np.linalg.solve: _solve,
    np.linalg.norm: _norm,
    np.real: lambda value: value,
    np.imag: lambda value: np.zeros(np.shape(value)),
    np.mean: _mean,
    **dict.fromkeys((np.max, np.amax), _extreme(np.maximum)),
    **dict.fromkeys((np.min, np.amin), _extreme(np.minimum)),
    **{each: _blank(each) for each in (np.zeros_like, np.ones_like, np.full_like)},
    np.empty_like: _blank(np.zeros_like),
    np.iscomplexobj: lambda value: False,
    np.isrealobj: lambda value: True,
    np.dot: lambda a, b: wrapped(np.dot(plain(as_traced(a)), plain(as_traced(b)))),
}
"""Functions of numpy with a separate version for traced arrays."""

_SAME_NAME = (
    "sin cos tan sinh cosh tanh exp log sqrt expm1 log1p log2 log10 exp2 asin acos atan atan2 pow fabs cbrt floor ceil "
    "trunc hypot copysign radians degrees"
)
"""Functions with the same name in math and numpy."""


def _most(plain: Callable[..., Any], ufunc: np.ufunc) -> Callable[..., Any]:
    def most(*values: Any, **options: Any) -> Any:
        flat = list(values[0]) if len(values) == 1 else list(values)
        return functools.reduce(SCALAR[ufunc.__name__], flat) if _has_traced(flat) else plain(flat, **options)

    return most


_INSTEAD: dict[int, Any] = {
    id(real): own
    for real, own in [
        *REPLACED.items(),
        (np.array, _array),
        (np.asarray, lambda value, *a, **o: value if isinstance(value, TracedArray) else _array(value, *a, **o)),
        (np.ascontiguousarray, lambda value, *a, **o: _array(value)),
        *((each, _blank(each)) for each in (np.zeros, np.ones, np.full)),
        (np.empty, _blank(np.zeros)),
        (np.eye, lambda *a, **o: as_traced(np.eye(*a, **o))),
        (np.identity, lambda *a, **o: as_traced(np.identity(*a, **o))),
        (np.float64, _float64),
        (builtins.float, _float),
        (builtins.max, _most(builtins.max, np.maximum)),
        (builtins.min, _most(builtins.min, np.minimum)),
        (math.fsum, lambda values: sum(values)),
        (math.fmod, lambda a, b: a - b * np.trunc(a / b)),
        *((getattr(math, name), getattr(np, name)) for name in _SAME_NAME.split()),
    ]
}
"""Stand-ins, by identity, for functions that do not accept traced numbers."""

_MODULES = {"numpy", "math", "numpy.linalg"}


class Module:
    """A module with functions for traced numbers."""

    def __init__(self, module: Any) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        return stand_in(getattr(self._module, name))


def stand_in(value: Any) -> Any:
    """Stand-in of a module, function or class while tracing; most stand for themselves."""
    if getattr(value, "__name__", None) in _MODULES and isinstance(value, type(math)):
        return Module(value)
    return _INSTEAD.get(id(value), value)
