"""Numbers and arrays that record what is done with them, and a numpy and a math that take them.

A function that is called with these records its operations in a :class:`chilopod.stability.tape.Graph`. Whatever needs
the value of a traced number (a branch, an index, a foreign library) raises :class:`Untraceable`; where that value
depends on the parameters only, :class:`Concrete`, and the function can be traced anew with those as plain numbers.
"""

from __future__ import annotations

import builtins
import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.stability import tape as ops
from chilopod.stability.tape import CONSTANT, Graph


class Untraceable(Exception):
    """A right-hand side that is no fixed sequence of known operations; the message says what stands against it."""


class Concrete(Exception):
    """The value of an expression of these parameters alone is needed."""

    def __init__(self, parameters: frozenset[int]) -> None:
        super().__init__()
        self.parameters = parameters


Number = Any
"""A float or a :class:`Traced`."""


class Traced:
    """One number under tracing: a node of a graph."""

    __slots__ = ("graph", "node")

    def __init__(self, graph: Graph, node: int) -> None:
        self.graph = graph
        self.node = node

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        return _apply(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, kinds: Any, args: Any, options: Any) -> Any:
        return _call(function, args, options)

    # Whoever asks for the value needs it.

    def _value(self, *_: Any) -> Any:
        if self.graph.depends[self.node] == CONSTANT:
            raise Concrete(frozenset(self.graph.nodes[i][1][0] for i in self.graph.leaves(self.node)))
        raise Untraceable("it asks for the value of a number: a branch, an index, or a function of another library")

    __bool__ = __float__ = __int__ = __index__ = __complex__ = __hash__ = __round__ = _value

    # Arithmetic

    def __add__(self, other: Any) -> Any:
        return _binary(np.add, self, other)

    def __radd__(self, other: Any) -> Any:
        return _binary(np.add, other, self)

    def __sub__(self, other: Any) -> Any:
        return _binary(np.subtract, self, other)

    def __rsub__(self, other: Any) -> Any:
        return _binary(np.subtract, other, self)

    def __mul__(self, other: Any) -> Any:
        return _binary(np.multiply, self, other)

    def __rmul__(self, other: Any) -> Any:
        return _binary(np.multiply, other, self)

    def __truediv__(self, other: Any) -> Any:
        return _binary(np.divide, self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return _binary(np.divide, other, self)

    def __pow__(self, other: Any) -> Any:
        return _binary(np.power, self, other)

    def __rpow__(self, other: Any) -> Any:
        return _binary(np.power, other, self)

    def __mod__(self, other: Any) -> Any:
        return _binary(np.remainder, self, other)

    def __rmod__(self, other: Any) -> Any:
        return _binary(np.remainder, other, self)

    def __floordiv__(self, other: Any) -> Any:
        return _binary(np.floor_divide, self, other)

    def __rfloordiv__(self, other: Any) -> Any:
        return _binary(np.floor_divide, other, self)

    def __neg__(self) -> Any:
        return _SCALAR["negative"](self)

    def __pos__(self) -> Any:
        return self

    def __abs__(self) -> Any:
        return _SCALAR["absolute"](self)

    def __floor__(self) -> Any:
        return _SCALAR["floor"](self)

    def __ceil__(self) -> Any:
        return _SCALAR["ceil"](self)

    def __lt__(self, other: Any) -> Any:
        return _binary(np.less, self, other)

    def __le__(self, other: Any) -> Any:
        return _binary(np.less_equal, self, other)

    def __gt__(self, other: Any) -> Any:
        return _binary(np.greater, self, other)

    def __ge__(self, other: Any) -> Any:
        return _binary(np.greater_equal, self, other)

    def __and__(self, other: Any) -> Any:
        return _binary(np.logical_and, self, other)

    __rand__ = __and__

    def __or__(self, other: Any) -> Any:
        return _binary(np.logical_or, self, other)

    __ror__ = __or__

    def __invert__(self) -> Any:
        return _SCALAR["logical_not"](self)

    # A number is an array of no dimension.

    @property
    def real(self) -> Traced:
        """The number itself."""
        return self

    @property
    def imag(self) -> float:
        """Zero."""
        return 0.0

    @property
    def shape(self) -> tuple[()]:
        """That of a number."""
        return ()

    ndim = 0
    size = 1
    dtype = np.dtype(np.float64)

    def conjugate(self) -> Traced:
        """The number itself."""
        return self

    def copy(self) -> Traced:
        """The number itself."""
        return self

    def item(self) -> Traced:
        """The number itself."""
        return self


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


def _number_of(graph: Graph, node: int) -> Any:
    value = graph.value(node)
    return Traced(graph, node) if value is None else value


def _graph_of(values: Any) -> Graph | None:
    return next((value.graph for value in values if isinstance(value, Traced)), None)


# Operations on single numbers, which may be traced or not; by the name of their ufunc.

_SCALAR: dict[str, Callable[..., Any]] = {}


def _scalar(*names: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    def register(build: Callable[..., int]) -> Callable[..., int]:
        for name in names:
            ufunc = getattr(np, name)

            def apply(*values: Any, ufunc: Any = ufunc) -> Any:
                graph = _graph_of(values)
                if graph is None:
                    return ufunc(*values)
                return _number_of(graph, build(graph, *(node_of(graph, value) for value in values)))

            _SCALAR[ufunc.__name__] = apply
        return build

    return register


def _one(g: Graph) -> int:
    return g.number(1.0)


for _name, _code in {
    "exp": ops.EXP,
    "sin": ops.SIN,
    "cos": ops.COS,
    "tan": ops.TAN,
    "sinh": ops.SINH,
    "cosh": ops.COSH,
    "tanh": ops.TANH,
    "log": ops.LOG,
    "sqrt": ops.SQRT,
    "arctan": ops.ATAN,
    "arcsin": ops.ASIN,
}.items():
    _scalar(_name)(lambda g, a, code=_code: g.function(code, a))

_scalar("add")(lambda g, a, b: g.add(a, b))
_scalar("subtract")(lambda g, a, b: g.add(a, b, -1.0))
_scalar("multiply")(lambda g, a, b: g.multiply(a, b))
_scalar("divide")(lambda g, a, b: g.divide(a, b))
_scalar("power", "float_power")(lambda g, a, b: g.power(a, b))
_scalar("negative")(lambda g, a: g.multiply(g.number(-1.0), a))
_scalar("positive", "conjugate")(lambda g, a: a)
_scalar("square")(lambda g, a: g.multiply(a, a))
_scalar("reciprocal")(lambda g, a: g.divide(_one(g), a))
_scalar("cbrt")(lambda g, a: g.multiply(g.step(a), g.power(g.multiply(g.step(a), a), g.number(1.0 / 3.0))))
_scalar("expm1")(lambda g, a: g.add(g.function(ops.EXP, a), _one(g), -1.0))
_scalar("log1p")(lambda g, a: g.function(ops.LOG, g.add(a, _one(g))))
_scalar("exp2")(lambda g, a: g.function(ops.EXP, g.multiply(g.number(math.log(2.0)), a)))
_scalar("log2")(lambda g, a: g.divide(g.function(ops.LOG, a), g.number(math.log(2.0))))
_scalar("log10")(lambda g, a: g.divide(g.function(ops.LOG, a), g.number(math.log(10.0))))
_scalar("arccos")(lambda g, a: g.add(g.number(0.5 * math.pi), g.function(ops.ASIN, a), -1.0))
_scalar("deg2rad", "radians")(lambda g, a: g.multiply(g.number(math.pi / 180.0), a))
_scalar("rad2deg", "degrees")(lambda g, a: g.multiply(g.number(180.0 / math.pi), a))
_scalar("absolute", "fabs")(lambda g, a: g.select(a, a, g.multiply(g.number(-1.0), a)))
_scalar("sign")(lambda g, a: g.step(a))
_scalar("heaviside")(lambda g, a, b: g.select(a, _one(g), g.number(0.0)))
_scalar("maximum", "fmax")(lambda g, a, b: g.select(g.add(a, b, -1.0), a, b))
_scalar("minimum", "fmin")(lambda g, a, b: g.select(g.add(a, b, -1.0), b, a))
_scalar("greater", "greater_equal")(lambda g, a, b: g.select(g.add(a, b, -1.0), _one(g), g.number(0.0)))
_scalar("less", "less_equal")(lambda g, a, b: g.select(g.add(a, b, -1.0), g.number(0.0), _one(g)))
_scalar("logical_not", "invert")(lambda g, a: g.add(_one(g), a, -1.0))
_scalar("logical_and", "bitwise_and")(lambda g, a, b: g.multiply(a, b))
_scalar("logical_or", "bitwise_or")(lambda g, a, b: g.add(g.add(a, b), g.multiply(a, b), -1.0))
_scalar("floor")(lambda g, a: g.floor(a))
_scalar("trunc")(lambda g, a: g.select(a, g.floor(a), _ceil(g, a)))
_scalar("floor_divide")(lambda g, a, b: g.floor(g.divide(a, b)))
_scalar("hypot")(lambda g, a, b: g.function(ops.SQRT, g.add(g.multiply(a, a), g.multiply(b, b))))
_scalar("copysign")(lambda g, a, b: g.multiply(g.select(a, a, g.multiply(g.number(-1.0), a)), g.step(b)))


@_scalar("ceil")
def _ceil(g: Graph, a: int) -> int:
    return g.multiply(g.number(-1.0), g.floor(g.multiply(g.number(-1.0), a)))


@_scalar("remainder")
def _remainder(g: Graph, a: int, b: int) -> int:
    return g.add(a, g.multiply(b, g.floor(g.divide(a, b))), -1.0)


@_scalar("arctan2")
def _arctan2(g: Graph, y: int, x: int) -> int:
    """In halves of the plane where one of the two quotients has no pole."""
    square = g.add(g.multiply(x, x), g.multiply(y, y), -1.0)
    minus = g.multiply(g.number(-1.0), x)
    beside = g.function(ops.ATAN, g.divide(y, x))
    turned = g.add(beside, g.multiply(g.number(math.pi), g.step(y)))
    across = g.multiply(g.number(0.5 * math.pi), g.step(y))
    upright = g.add(across, g.function(ops.ATAN, g.divide(minus, y)))
    return g.select(square, g.select(x, beside, turned), upright)


def _binary(ufunc: np.ufunc, a: Any, b: Any) -> Any:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray) or isinstance(a, list) or isinstance(b, list):
        return ufunc(as_traced(a), b)
    return _SCALAR[ufunc.__name__](a, b)


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
    return _number_of(graph, graph.select(switch, a, b))


# Arrays


class TracedArray(np.ndarray[Any, np.dtype[Any]]):
    """An array of traced and plain numbers."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        return _apply(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, kinds: Any, args: Any, options: Any) -> Any:
        return _call(function, args, options)

    def astype(self, *_: Any, **__: Any) -> Any:  # type: ignore[override]
        """A copy."""
        return self.copy()

    @property
    def real(self) -> Any:
        """The array itself."""
        return self

    @property
    def imag(self) -> Any:
        """Zeros."""
        return np.zeros(self.shape)

    def max(self, axis: Any = None, **_: Any) -> Any:  # type: ignore[override]
        """The largest."""
        return np.maximum.reduce(self, axis=axis)

    def min(self, axis: Any = None, **_: Any) -> Any:  # type: ignore[override]
        """The smallest."""
        return np.minimum.reduce(self, axis=axis)

    def clip(self, low: Any = None, high: Any = None, **_: Any) -> Any:  # type: ignore[override]
        """Between bounds."""
        return _clip(self, low, high)


def as_traced(value: Any) -> Any:
    """Anything like an array as one that may hold traced numbers."""
    if isinstance(value, TracedArray):
        return value
    if isinstance(value, Traced):
        array = np.empty((), dtype=object)
        array[()] = value
        return array.view(TracedArray)
    return np.array(value, dtype=object).view(TracedArray)


def _plain(value: Any) -> Any:
    return value.view(np.ndarray) if isinstance(value, TracedArray) else value


def _wrapped(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype == object:
        return value.view(TracedArray) if value.ndim else value[()]
    return value


@functools.cache
def _elementwise(name: str, operands: int) -> Any:
    return np.frompyfunc(_SCALAR[name], operands, 1)


def _apply(ufunc: np.ufunc, method: str, inputs: tuple[Any, ...], options: dict[str, Any]) -> Any:
    out = options.pop("out", None)
    options = {key: value for key, value in options.items() if key not in ("dtype", "casting", "subok", "order")}
    if options.pop("where", True) is not True:
        raise Untraceable(f"it calls numpy.{ufunc.__name__} with where=")
    operands = [_plain(value if isinstance(value, np.ndarray) else as_traced(value)) for value in inputs]
    if ufunc is np.matmul and method == "__call__":
        result = _matmul(operands[0], operands[1])
    elif ufunc.__name__ not in _SCALAR:
        raise Untraceable(f"it calls numpy.{ufunc.__name__}")
    else:
        result = getattr(_elementwise(ufunc.__name__, ufunc.nin), method)(*operands, **options)
    if out is not None:
        if not isinstance(out[0], TracedArray):
            raise Untraceable("it writes into an array of plain numbers")
        _plain(out[0])[...] = result
        return out[0]
    return _wrapped(result)


def _matmul(a: Any, b: Any) -> Any:
    return np.dot(a.astype(object), b.astype(object)) if b.ndim <= 2 else np.matmul(a, b)


def _call(function: Any, args: tuple[Any, ...], options: dict[str, Any]) -> Any:
    own = _FUNCTIONS.get(function)
    if own is not None:
        return own(*args, **options)

    def bare(value: Any) -> Any:
        if isinstance(value, tuple | list):
            return type(value)(bare(part) for part in value)
        return _plain(as_traced(value)) if isinstance(value, Traced) else _plain(value)

    result = function(*bare(args), **{key: bare(value) for key, value in options.items()})
    return type(result)(_wrapped(part) for part in result) if isinstance(result, tuple | list) else _wrapped(result)


def _clip(value: Any, low: Any = None, high: Any = None, **_: Any) -> Any:
    if low is not None:
        value = np.maximum(as_traced(value), low)
    return value if high is None else np.minimum(as_traced(value), high)


def _where_arrays(condition: Any, *choices: Any) -> Any:
    if len(choices) != 2:
        raise Untraceable("it asks where an array is not zero")
    return _wrapped(np.frompyfunc(_where, 3, 1)(*(_plain(as_traced(value)) for value in (condition, *choices))))


def _solve(matrix: Any, right: Any) -> Any:
    """Gaussian elimination; where the size of a pivot is not known, the one on the diagonal is taken."""
    if not (_has_traced(matrix) or _has_traced(right)):
        return np.linalg.solve(matrix, right)
    a, b = _plain(as_traced(matrix)).copy(), _plain(as_traced(right)).copy()
    n = a.shape[0]
    if a.shape != (n, n):
        raise Untraceable("it solves with a stack of matrices")

    def worth(value: Any) -> float:
        return -1.0 if isinstance(value, Traced) else abs(value)

    for column in range(n):
        rows = range(column, n)
        pivot = max(rows, key=lambda row: worth(a[row, column]))
        if any(isinstance(a[row, column], Traced) for row in rows):
            # Which one is large enough is not known now: the one on the diagonal, as of every mass matrix.
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
    """Arrays of floats may be written into later; those of whole numbers are indices."""
    if _has_traced(value):
        result = (
            as_traced([as_traced(part) if isinstance(part, TracedArray) else part for part in value])
            if isinstance(value, list | tuple)
            else as_traced(value).copy()
        )
        return result
    result = np.array(value, *args, **{key: part for key, part in options.items() if key != "like"})
    return as_traced(result) if result.dtype.kind == "f" and result.ndim == 1 else result


def _blank(make: Callable[..., Any]) -> Callable[..., Any]:
    def shaped(*args: Any, **options: Any) -> Any:
        if any(_has_traced(value) for value in args[1:]) or _has_traced(options.get("fill_value")):
            shape, value = args[0], options.get("fill_value", args[1] if len(args) > 1 else 0.0)
            result = np.empty(np.shape(shape) if make is np.full_like else shape, dtype=object)
            result[...] = value
            return result.view(TracedArray)
        options = {key: value for key, value in options.items() if not (key == "dtype" and value is object)}
        args = tuple(_numeric(value) for value in args)
        if len(args) > 1 and args[1] == np.dtype(object):
            args = (args[0], *args[2:])
        if options.get("dtype") == np.dtype(object):
            del options["dtype"]
        result = make(*args, **options)
        return as_traced(np.nan_to_num(result)) if result.dtype.kind == "f" else result

    return shaped


def _numeric(value: Any) -> Any:
    return np.zeros(value.shape) if isinstance(value, TracedArray) else value


def _norm(value: Any, ord: Any = None, axis: Any = None, **_: Any) -> Any:
    if ord not in (None, 2) or (axis is None and np.ndim(value) != 1 and ord is not None):
        raise Untraceable("it takes a norm other than Euclid's")
    return np.sqrt(np.add.reduce(as_traced(value) ** 2, axis=axis))


def _extreme(ufunc: np.ufunc) -> Callable[..., Any]:
    return lambda value, axis=None, **_: ufunc.reduce(as_traced(value), axis=axis)


_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.where: _where_arrays,
    np.clip: _clip,
    np.linalg.solve: _solve,
    np.linalg.norm: _norm,
    np.real: lambda value: value,
    np.imag: lambda value: np.zeros(np.shape(value)),
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
    np.dot: lambda a, b: _wrapped(np.dot(_plain(as_traced(a)), _plain(as_traced(b)))),
}


def _instead() -> dict[int, Any]:
    """What stands in for functions that take no traced numbers, by identity."""
    pairs: list[tuple[Any, Any]] = [
        (np.array, _array),
        (np.asarray, lambda value, *a, **o: value if isinstance(value, TracedArray) else _array(value, *a, **o)),
        (np.ascontiguousarray, lambda value, *a, **o: _array(value)),
        (np.zeros, _blank(np.zeros)),
        (np.empty, _blank(np.zeros)),
        (np.ones, _blank(np.ones)),
        (np.full, _blank(np.full)),
        (np.zeros_like, _blank(np.zeros_like)),
        (np.ones_like, _blank(np.ones_like)),
        (np.empty_like, _blank(np.zeros_like)),
        (np.eye, lambda *a, **o: as_traced(np.eye(*a, **o))),
        (np.identity, lambda *a, **o: as_traced(np.identity(*a, **o))),
        (np.float64, lambda value=0.0: value if _has_traced(value) else np.float64(value)),
        (builtins.float, lambda value=0.0: value if isinstance(value, Traced) else float(value)),
        (builtins.max, _most(builtins.max, np.maximum)),
        (builtins.min, _most(builtins.min, np.minimum)),
        (math.fsum, lambda values: sum(values)),
        (math.atan, np.arctan),
        (math.asin, np.arcsin),
        (math.acos, np.arccos),
        (math.atan2, np.arctan2),
        (math.pow, np.power),
        (math.fmod, lambda a, b: a - b * np.trunc(a / b)),
        (math.fabs, np.abs),
    ]
    pairs += [
        (getattr(math, name), getattr(np, name))
        for name in [
            "sin",
            "cos",
            "tan",
            "sinh",
            "cosh",
            "tanh",
            "exp",
            "log",
            "sqrt",
            "expm1",
            "log1p",
            "log2",
            "log10",
            "floor",
            "ceil",
            "trunc",
            "hypot",
            "copysign",
            "cbrt",
            "exp2",
            "radians",
            "degrees",
        ]
    ]
    return {id(real): own for real, own in [*_FUNCTIONS.items(), *pairs]}


def _most(plain: Callable[..., Any], ufunc: np.ufunc) -> Callable[..., Any]:
    def most(*values: Any, **options: Any) -> Any:
        flat = list(values[0]) if len(values) == 1 else list(values)
        return functools.reduce(_SCALAR[ufunc.__name__], flat) if _has_traced(flat) else plain(flat, **options)

    return most


class Module:
    """A module whose functions take traced numbers."""

    def __init__(self, module: Any) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        return stand_in(getattr(self._module, name))


_INSTEAD = _instead()
_MODULES = {"numpy", "math", "numpy.linalg"}


def stand_in(value: Any) -> Any:
    """What takes the place of a module, function or class while tracing: mostly itself."""
    if getattr(value, "__name__", None) in _MODULES and isinstance(value, type(math)):
        return Module(value)
    return _INSTEAD.get(id(value), value)


def states(graph: Graph, dimension: int) -> NDArray[Any]:
    """The states of a graph as an array."""
    return as_traced([Traced(graph, i) for i in range(dimension)])
