"""Tapes of right-hand sides: traced, verified, cached, and evaluated for checks (not for integration).

:func:`trace` describes the function by its code and everything that the code refers to (:func:`describe`), and looks
for a tape with this description. If none is found, it

1. rebuilds the function with traced numbers in place of its floats, and stand-ins for numpy and math (:func:`rebuild`);
2. calls that with traced states, which records the operations in a graph, and orders them into a tape;
3. compares the values of the tape with those of the function at several states;
4. keeps the tape for all functions of the same description, whose floats become parameters.
"""

from __future__ import annotations

import builtins
import functools
import itertools
import sys
import types
import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import AnalysisError
from chilopod.flows.arguments import as_real
from chilopod.flows.tracing.graph import Graph, NeedsValues
from chilopod.flows.tracing.ordering import ordered
from chilopod.flows.tracing.tape import FLOOR, GUARD, Integers, Tape
from chilopod.flows.tracing.traced import Traced, Untraceable, as_traced, node_of, stand_in
from chilopod.frozen import Array

_MOST_NODES = 200_000
_MOST_KEPT = 64
_AGREES = 1e-9
_NEAR = 1e-13


class Opaque(Exception):
    """A function holds an object whose contents may change unnoticed, so its tape cannot be cached."""


@dataclass(frozen=True)
class Trace:
    """A tape and the values of its parameters for one function with its arguments."""

    tape: Tape  # operations, shared by all functions that differ in floats only
    params: Array  # values of the parameters, shape (parameters,)
    derived: dict[Any, Any]  # cache of results that depend on the tape alone


_Fixed = tuple[int, ...]
"""Numbers of the floats whose values the operations depend on."""
_Tapes = dict[tuple[float, ...], tuple[Tape, dict[Any, Any]]]
"""Tapes of a description by the values of these floats, and results derived from each."""
_KEPT: weakref.WeakKeyDictionary[types.CodeType, dict[Any, tuple[_Fixed, _Tapes]]] = weakref.WeakKeyDictionary()


def trace(
    rhs: Callable[..., ArrayLike],
    dimension: int,
    args: tuple[Any, ...] = (),
    *,
    times: Sequence[float] = (0.0, 1.0),
    base: ArrayLike | None = None,
    events: Sequence[tuple[Callable[..., Any], Callable[..., ArrayLike] | None]] = (),
) -> Trace:
    """Record the operations of a right-hand side, once for all values of its floats.

    Floats in ``args``, alone or in arrays, tuples and lists, are parameters of the tape, or numbers if the function
    needs their values, as in a branch or for an exponent. ``events`` are pairs of a guard and a reset or None; the tape
    is compared with the function around a state ``base``. Raises Untraceable if it is no fixed sequence of known
    operations.
    """
    functions = (rhs, *(part for event in events for part in event))
    floats: list[float] = []
    seen: dict[int, int] = {}
    code = getattr(python_function(rhs), "__code__", None)
    try:
        key: Any = (dimension, describe(functions, floats, seen), describe(args, floats, seen))
        kept = {} if code is None else _KEPT.setdefault(code, {})
        fixed, tapes = kept.get(key, ((), {}))
    except (Opaque, TypeError, ValueError):  # not hashable, an empty cell
        key, floats, kept, fixed, tapes = None, [], {}, (), {}
    known = tapes.get(tuple([floats[i] for i in fixed]))
    if known is None:
        tape, fixed = _traced(functions, dimension, args, floats, fixed)
        _verify(tape, np.array(floats[: tape.parameters]), functions, args, times, base)
        for full in (kept, tapes):
            if len(full) >= _MOST_KEPT:
                full.clear()
        kept[key] = fixed, tapes
        known = tapes[tuple([floats[i] for i in fixed])] = tape, {}
    tape, derived = known
    return Trace(tape, np.array(floats[: tape.parameters]), derived)


def _traced(
    functions: tuple[Any, ...], dimension: int, args: tuple[Any, ...], floats: list[float], fixed: _Fixed
) -> tuple[Tape, _Fixed]:
    """The tape, with some floats fixed to their values, and the rest as parameters; more are fixed where needed."""
    every = tuple(range(len(floats)))
    while True:
        try:
            return _recorded(functions, dimension, args, floats, fixed), fixed
        except NeedsValues as needed:
            fixed = tuple(sorted({*fixed, *needed.parameters}))
        except Untraceable:
            if fixed == every:
                raise
            fixed = every


def _recorded(
    functions: tuple[Any, ...], dimension: int, args: tuple[Any, ...], floats: list[float], fixed: _Fixed
) -> Tape:
    graph = Graph(dimension, 0 if len(fixed) == len(floats) else len(floats))
    source = None
    if graph.parameters:
        source = iter([floats[i] if i in fixed else Traced(graph, node) for i, node in enumerate(graph.parameters)])
    try:
        seen: dict[int, Any] = {}
        rhs, *event_functions = rebuild(functions, source, seen)
        results = functools.partial(_results, graph, rebuild(args, source, seen))
        slopes = results(rhs, dimension)
        guards = [results(guard, None)[0] for guard in event_functions[::2]]
        resets = [graph.states if reset is None else results(reset, dimension) for reset in event_functions[1::2]]
        return ordered(graph, slopes, guards, resets)
    except (NeedsValues, Untraceable):
        raise
    except RecursionError:
        raise Untraceable("it is too deeply nested") from None
    except Exception as error:  # any exception of a user's function means the same
        raise Untraceable(f"{type(error).__name__}: {error}") from None


def _results(graph: Graph, args: tuple[Any, ...], function: Any, count: int | None) -> list[int]:
    """Nodes of the results of a rebuilt function; a ``count`` of None means one number."""
    states = as_traced([Traced(graph, node) for node in graph.states])
    with np.errstate(all="ignore"):
        array = as_traced(function(Traced(graph, graph.time), states, *args))
    if count is not None and array.shape != (count,):
        raise Untraceable(f"returns the shape {array.shape}")
    if count is None and array.size != 1:
        raise Untraceable("a guard must return one number")
    if len(graph.nodes) > _MOST_NODES:
        raise Untraceable("it takes too many operations")
    return [node_of(graph, value) for value in array.ravel()]


def _verify(
    tape: Tape, params: Array, functions: tuple[Any, ...], args: tuple[Any, ...], times: Sequence[float], base: Any
) -> None:
    """Compare the tape with the right-hand side, guards and resets at states of various sizes."""
    n, (rhs, *event_functions) = tape.dimension, functions
    checked = [(rhs, tape.slopes)]
    for kind, node, event in tape.switches.T:
        if kind == GUARD:
            guard, reset = event_functions[2 * event : 2 * event + 2]
            checked.append((lambda *given, guard=guard: np.ravel(guard(*given)), np.array([node])))
            if reset is not None:
                checked.append((reset, tape.resets[event]))
    around = np.zeros(n) if base is None else np.asarray(base, dtype=np.float64)
    size = float(np.abs(around).max()) or 1.0
    low, high = float(min(times)), float(max(times))
    places = []
    for i, (spread, turn) in enumerate(itertools.product((0.01, 0.3, 1.0), (0.3, 1.7, 4.1))):
        t = low + (high - low) * ((0.6180339887 * (i + 1)) % 1.0)
        x = around + spread * np.where(around == 0.0, size, np.abs(around)) * np.cos(3.0 * np.arange(n) + turn)
        places.append((t, x))
    for function, nodes in checked:
        _compare(tape, params, lambda t, x, f=function: as_real(f(t, x.copy(), *args)), nodes, places)


def _compare(
    tape: Tape, params: Array, function: Callable[..., Array], nodes: Integers, places: list[tuple[float, Array]]
) -> None:
    """Untraceable if nodes have other values than a function of time and state."""
    found = []
    for t, x in places:
        try:
            with np.errstate(all="ignore"):
                real = function(t, x)
        except Exception:  # not defined at this state
            continue
        own = evaluate(tape, nodes, t, x, params)
        beside = x * (1 + _NEAR * np.cos(np.arange(x.size)))
        near = evaluate(tape, nodes, t * (1 + _NEAR), beside, params * (1 - _NEAR))
        found.append((t, x, real, own, np.abs(near - own)))
    if not found:
        raise Untraceable("it could not be evaluated at any state that was tried")
    times, states, *values = zip(*found, strict=True)
    real, own, rounding = map(np.array, values)
    if real.shape != own.shape:
        raise Untraceable(f"returns the shape {real.shape[1:]}")
    both = np.isfinite(real) & np.isfinite(own)
    size_of = np.abs(np.where(both, real, 0.0)).max(axis=0)
    # The order of sums differs, which matters where the function is sensitive to it, as sin of large numbers.
    allowed = _AGREES * size_of + np.where(both, rounding, 0.0)
    lost = np.isfinite(real).all(axis=1) & ~np.isfinite(own).all(axis=1)
    if lost.any() or (np.abs(np.where(both, real - own, 0.0)) > allowed).any():
        with np.errstate(all="ignore"):
            again = np.array([*map(function, times, states)])
        if np.array_equal(again, real, equal_nan=True):
            raise Untraceable("it uses an operation that is recorded with other values than numpy's")
        raise Untraceable("it gives other values when called again: it has memory or random numbers")


def evaluate(tape: Tape, nodes: Integers, t: Any, x: Any, params: Array) -> Array:
    """Values of nodes, shape (nodes, ...), at times (...) and states (n, ...), or one of either."""
    from chilopod.flows.tracing import series  # numba takes half a second to import

    # Copies, because numba would compile again for read-only arrays.
    times, states = np.array(t, dtype=np.float64, ndmin=1), np.array(x, dtype=np.float64).reshape(len(x), -1)
    found = np.empty((nodes.size, max(times.size, states.shape[1])))
    series.sample(tape, np.array(params, dtype=np.float64), times, states, nodes, found)
    return found.reshape(-1, *(np.shape(t) or np.shape(x)[1:]))


def evaluate_jacobian(tape: Tape, t: float, x: Array, params: Array) -> tuple[Array, Array]:
    """dx/dt, shape (n,), and its derivative with respect to the state, shape (n, n)."""
    found = evaluate_series(tape, np.stack([np.tile(x, (x.size, 1)), np.eye(x.size)], axis=1), params, t, False)
    return found[0, 0], found[:, 1].T.copy()


def evaluate_series(tape: Tape, curves: Array, params: Array, t: float = 0.0, smooth: bool = True) -> Array:
    """Taylor coefficients in s of f(t, x(s)), shape (curves, orders, n), along the curves x(s) = c0 + c1 s + ... with
    these coefficients, of the same shape; AnalysisError if one starts on a switching surface, where f is not smooth."""
    from chilopod.flows.tracing import series

    kinds, surfaces = tape.switches[:2]
    result, branches = np.empty(curves.shape), np.zeros(kinds.size)
    for curve, out in zip(np.array(curves, dtype=np.float64), result, strict=True):
        if kinds.size:
            functions = evaluate(tape, surfaces, t, curve[0], params)
            branches = branches_of(tape, functions)
            there = (functions == np.where(kinds == FLOOR, branches, 0.0)) & (kinds != GUARD)
            if smooth and there.any():
                said = "has no derivatives in a state on a switching surface"
                raise AnalysisError(said, field="rhs", allowed="an equilibrium away from it")
        series.compose(tape, np.array(params, dtype=np.float64), float(t), curve, branches, out)
    return result


def branches_of(tape: Tape, functions: Array) -> Array:
    """Branches of the switches by the values of their functions, shapes (switches, ...)."""
    floors = (tape.switches[0] == FLOOR).reshape(-1, *[1] * (functions.ndim - 1))
    return np.where(floors, np.floor(functions), np.where(functions >= 0.0, 1.0, -1.0))


_PLAIN = (int, bool, str, bytes, complex, type(None), np.integer, np.bool_)
_FLOAT, _ROW = (float, np.floating), (tuple, list)  # np.float64 is a float
_FUNCTIONS = types.FunctionType, type(np.dot)
_OUTSIDE = ("numpy", "scipy", "math", "builtins", "numba")


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
    """A hashable description of a value; all its floats are appended to a list. Raises Opaque for unknown kinds.

    The floats among a function's arguments, defaults, closure and globals become parameters of the tape; whole numbers,
    strings and the code itself are part of its cache key: a family of lambdas is traced once, a changed global anew.
    """
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


def _rebuilt_function(value: types.FunctionType, source: Iterator[Any] | None, seen: dict[int, Any]) -> Any:
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
