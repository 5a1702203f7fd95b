"""Numbers and arrays that record operations.

A function that is called with these records its operations in a :class:`chilopod.flows.tracing.graph.Graph`.
A use of the value of a traced number (a branch, an index, a foreign library) raises :class:`Untraceable`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.flows.tracing.graph import BUILDS, Graph


class Untraceable(Exception):
    """A right-hand side is not a fixed sequence of known operations; the message names the obstacle."""


Number = Any
"""A float or a :class:`Traced`."""


class _Recording:
    __slots__ = ()

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        return _apply(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, kinds: Any, args: Any, options: Any) -> Any:
        return _call(function, args, options)


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

REPLACED: dict[Any, Callable[..., Any]] = {}
"""Functions of numpy with a separate version for traced arrays (see :mod:`.standins`)."""


def _replaced(name: str) -> Any:
    return lambda self, *args, **options: REPLACED[getattr(np, name)](self, *args, **options)


class TracedArray(_Recording, np.ndarray[Any, np.dtype[Any]]):
    """An array of traced and plain numbers."""

    real = property(lambda self: self)
    imag = property(lambda self: np.zeros(self.shape))

    def astype(self, *_: Any, **__: Any) -> Any:
        return self.copy()

    max = _replaced("max")
    min = _replaced("min")
    mean = _replaced("mean")
    clip = _replaced("clip")


def as_traced(value: Any) -> Any:
    """An array-like as an array that may hold traced numbers."""
    if isinstance(value, TracedArray):
        return value
    if isinstance(value, Traced):
        array = np.empty((), dtype=object)
        array[()] = value
        return array.view(TracedArray)
    return np.array(value, dtype=object).view(TracedArray)


def plain(value: Any) -> Any:
    """A traced array as an ordinary array of objects."""
    return value.view(np.ndarray) if isinstance(value, TracedArray) else value


def wrapped(value: Any) -> Any:
    """The inverse of :func:`plain`; an array without dimensions becomes its number."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        return value.view(TracedArray) if value.ndim else value[()]
    return value


@functools.cache
def _elementwise(name: str, operands: int) -> Any:
    return np.frompyfunc(SCALAR[name], operands, 1)


def _apply(ufunc: np.ufunc, method: str, inputs: tuple[Any, ...], options: dict[str, Any]) -> Any:
    out = options.pop("out", None)
    options = {key: value for key, value in options.items() if key not in ("dtype", "casting", "subok", "order")}
    if options.pop("where", True) is not True:
        raise Untraceable(f"it calls numpy.{ufunc.__name__} with where=")
    if out is not None and isinstance(out[0], Traced):
        out = None  # as in x += 1: the name now refers to another number
    operands = [plain(value if isinstance(value, np.ndarray) else as_traced(value)) for value in inputs]
    if ufunc is np.matmul and method == "__call__":
        result = _matmul(operands[0], operands[1])
    elif ufunc.__name__ not in SCALAR:
        raise Untraceable(f"it calls numpy.{ufunc.__name__}")
    else:
        result = getattr(_elementwise(ufunc.__name__, ufunc.nin), method)(*operands, **options)
    if out is not None:
        if not isinstance(out[0], TracedArray):
            raise Untraceable("it writes into an array of plain numbers")
        plain(out[0])[...] = result
        return out[0]
    return wrapped(result)


def _matmul(a: Any, b: Any) -> Any:
    return np.dot(a.astype(object), b.astype(object)) if b.ndim <= 2 else np.matmul(a, b)


def _call(function: Any, args: tuple[Any, ...], options: dict[str, Any]) -> Any:
    own = REPLACED.get(function)
    if own is not None:
        return own(*args, **options)

    def bare(value: Any) -> Any:
        if isinstance(value, tuple | list):
            return type(value)(bare(part) for part in value)
        return plain(as_traced(value)) if isinstance(value, Traced) else plain(value)

    result = function(*bare(args), **{key: bare(value) for key, value in options.items()})
    return type(result)(wrapped(part) for part in result) if isinstance(result, tuple | list) else wrapped(result)


def states(graph: Graph) -> NDArray[Any]:
    """The states of a graph as an array."""
    return as_traced([Traced(graph, node) for node in graph.states])
