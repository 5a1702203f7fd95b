"""Operations under construction, with shared subexpressions, folded numbers and gathered sums.

A node is an operation with its operands, which are earlier nodes; equal operations are one node. A :class:`Graph` has
methods for the arithmetic, in which numbers are computed at once, equal terms of a sum are added up, and constants
move to the front of products. ``FUNCTIONS`` are the elementary functions with their derivatives; ``BUILDS`` gives the
nodes of every ufunc of numpy that can be traced, in terms of these.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.bernoulli import HIGHEST, bernoulli

_ROUNDING = 1e-15  # relative difference of numbers that are equal but for rounding

Node = tuple[int, tuple[int, ...]]


class Function(NamedTuple):
    """An elementary function c = phi(a), with c' = w a' up to the sign of the cosine's."""

    value: Callable[[float], float]
    weight: Callable[[Graph, int, int], int]  # ``weight(graph, a, c)`` -> w


FUNCTIONS = {
    ops.EXP: Function(math.exp, lambda g, a, c: c),
    ops.SIN: Function(math.sin, lambda g, a, c: g.function(ops.COS, a)),
    ops.COS: Function(math.cos, lambda g, a, c: g.function(ops.SIN, a)),
    ops.TAN: Function(math.tan, lambda g, a, c: g.add(g.number(1.0), g.multiply(c, c))),
    ops.SINH: Function(math.sinh, lambda g, a, c: g.function(ops.COSH, a)),
    ops.COSH: Function(math.cosh, lambda g, a, c: g.function(ops.SINH, a)),
    ops.TANH: Function(math.tanh, lambda g, a, c: g.add(g.number(1.0), g.multiply(c, c), -1.0)),
    ops.LOG: Function(math.log, lambda g, a, c: g.divide(g.number(1.0), a)),
    ops.SQRT: Function(math.sqrt, lambda g, a, c: g.divide(g.number(0.5), c)),
    ops.ATAN: Function(math.atan, lambda g, a, c: g.divide(g.number(1.0), g.add(g.number(1.0), g.multiply(a, a)))),
    ops.ASIN: Function(
        math.asin,
        lambda g, a, c: g.divide(g.number(1.0), g.function(ops.SQRT, g.add(g.number(1.0), g.multiply(a, a), -1.0))),
    ),
}

LEAVES = {ops.STATE: ops.MOVING, ops.TIME: ops.TIMED, ops.PARAMETER: ops.CONSTANT, ops.NUMBER: ops.CONSTANT}


class NeedsValues(Exception):
    """The operations depend on the values of some parameters, whose numbers are given."""

    def __init__(self, parameters: set[int]) -> None:
        super().__init__()
        self.parameters = parameters


class Graph:
    """Operations under construction; nodes are numbered in order of creation."""

    def __init__(self, dimension: int, parameters: int) -> None:
        self.nodes: list[Node] = []
        self.depends: list[int] = []
        self.weights: dict[int, int] = {}  # w of every function node
        self._known: dict[Node, int] = {}
        self.states = [self._new(ops.STATE, (i,)) for i in range(dimension)]
        self.time = self._new(ops.TIME, ())
        self.parameters = [self._new(ops.PARAMETER, (i,)) for i in range(parameters)]

    def _new(self, code: int, operands: tuple[int, ...]) -> int:
        node = (code, operands)
        if node not in self._known:
            self._known[node] = len(self.nodes)
            self.nodes.append(node)
            self.depends.append(LEAVES[code] if code in LEAVES else max(self.depends[i] for i in operands))
        return self._known[node]

    def _weighted(self, code: int, operands: tuple[int, ...], weight: Callable[[int], int]) -> int:
        """The node of a function, and its w."""
        node = self._new(code, operands)
        if node not in self.weights:
            self.weights[node] = -1  # w may depend on the node itself
            self.weights[node] = weight(node)
        return node

    def number(self, value: float) -> int:
        """The node of a number."""
        # The bits, because NaN does not equal itself and 0.0 equals -0.0.
        return self._new(ops.NUMBER, (int(np.float64(value).view(np.int64)),))

    def value(self, node: int) -> float | None:
        """The value of a number node; None for any other."""
        code, operands = self.nodes[node]
        return float(np.int64(operands[0]).view(np.float64)) if code == ops.NUMBER else None

    def terms(self, node: int) -> list[tuple[int, int]]:
        """Terms of a sum: pairs of weight and node."""
        operands = self.nodes[node][1]
        return list(zip(operands[::2], operands[1::2], strict=True))

    def linear(self, terms: Sequence[tuple[int, int]]) -> int:
        """A sum of nodes with constant weights."""
        constant, one = 0.0, self.number(1.0)
        kept: dict[int, int] = {}
        for weight, node in terms:
            w, v = self.value(weight), self.value(node)
            if w is not None and v is not None:
                constant += w * v
                continue
            if node in kept:
                weight = self.linear([(one, kept.pop(node)), (one, weight)])
            if self.value(weight) != 0.0:
                kept[node] = weight
        if not kept:
            return self.number(constant)
        if constant != 0.0:
            kept[self.number(constant)] = one
        if len(kept) == 1:
            ((node, weight),) = kept.items()
            if weight == one:
                return node
        return self._new(ops.LINEAR, tuple(i for node in sorted(kept) for i in (kept[node], node)))

    def add(self, a: int, b: int, sign: float = 1.0) -> int:
        """a + sign b."""
        return self.linear([(self.number(1.0), a), (self.number(sign), b)])

    def multiply(self, a: int, b: int) -> int:
        """a b."""
        # Numbers come first, then other constants.
        a, b = sorted((a, b), key=lambda node: (self.value(node) is None, self.depends[node], node))
        va, vb = self.value(a), self.value(b)
        if va is not None:
            if vb is not None:
                return self.number(va * vb)
            if va == 0.0:
                return self.number(0.0)
            if va == 1.0:
                return b
            code, operands = self.nodes[b]
            if code == ops.LINEAR and len(operands) == 2:
                return self.linear([(self.multiply(a, operands[0]), operands[1])])
        if va is not None or (self.depends[a] == ops.CONSTANT and self.depends[b] != ops.CONSTANT):
            return self.linear([(a, b)])
        if a == b:
            return self._new(ops.SQUARE, (a,))
        # Constants in front of a factor move to the front of the product, at no cost.
        for one, other in ((a, b), (b, a)):
            code, operands = self.nodes[one]
            if code == ops.LINEAR and len(operands) == 2 and self.depends[other] != ops.CONSTANT:
                return self.linear([(operands[0], self.multiply(operands[1], other))])
        for one, other in ((a, b), (b, a)):
            if self.depends[one] == ops.MOVING and self.nodes[other] == (ops.SQUARE, (one,)):
                # A cube is a function with w = 3 a^2, which saves two of three products in the tangents.
                node = self._new(ops.POWER, (one, self.number(3.0)))
                self.weights[node] = self.linear([(self.number(3.0), other)])
                return node
        return self._new(ops.PRODUCT, (a, b))

    def divide(self, a: int, b: int) -> int:
        """a / b."""
        va, vb = self.value(a), self.value(b)
        if vb is not None and vb != 0.0:
            if va is not None:
                return self.number(va / vb)
            if math.frexp(vb)[0] in (0.5, -0.5):
                return self.multiply(self.number(1.0 / vb), a)  # exact
        if va == 0.0 and vb is None:
            return self.number(0.0)
        if (smooth := self._smooth_quotient(a, b)) is not None:
            return smooth
        if self.depends[b] == ops.CONSTANT and self.depends[a] != ops.CONSTANT:
            return self.multiply(self._new(ops.QUOTIENT, (self.number(1.0), b)), a)
        return self._new(ops.QUOTIENT, (a, b))

    def bernoulli(self, a: int, order: int = 0) -> int:
        """The derivative of some order of u / (exp(u) - 1)."""
        if (value := self.value(a)) is not None:
            return self.number(bernoulli(value, order))
        operands = a, self.number(float(order))
        if order == HIGHEST:
            return self._weighted(ops.BERNOULLI, operands, lambda _: self.number(0.0))
        return self._weighted(ops.BERNOULLI, operands, lambda _: self.bernoulli(a, order + 1))

    def _smooth_quotient(self, a: int, b: int) -> int | None:
        """a / b as a multiple of the Bernoulli function, if b is c (exp(u) - 1) and a a multiple of u; else None."""
        if self.depends[b] != ops.MOVING or self.nodes[b][0] != ops.LINEAR or len(self.terms(b)) != 2:
            return None
        (_, one), (c, exponential) = sorted(self.terms(b), key=lambda term: self.value(term[1]) is None)
        if (
            self.nodes[exponential][0] != ops.EXP
            or self.value(one) is None
            or self.multiply(c, self.number(-1.0)) != one
        ):
            return None
        (u,) = self.nodes[exponential][1]
        scale, core = self._split(u)
        for part, rest in self._factors(a):
            weight, other = self._split(part)
            share = self.divide(weight, scale) if other == core else self._ratio(part, u)
            if share is not None:
                smooth = self.multiply(self.divide(share, c), self.bernoulli(u))
                return smooth if rest is None else self.multiply(smooth, rest)
        return None

    def _split(self, node: int) -> tuple[int, int]:
        """A constant factor of a node, and the node without it."""
        factor = self.number(1.0)
        while self.nodes[node][0] == ops.LINEAR and len(self.terms(node)) == 1:
            ((weight, node),) = self.terms(node)
            factor = self.multiply(factor, weight)
        return factor, node

    def _factors(self, node: int) -> list[tuple[int, int | None]]:
        """Pairs of a factor of a node and the rest, None for 1."""
        factor, core = self._split(node)
        if self.nodes[core][0] != ops.PRODUCT:
            return [(node, None)]
        a, b = self.nodes[core][1]
        return [(node, None), (a, self.multiply(factor, b)), (b, self.multiply(factor, a))]

    def _ratio(self, a: int, b: int) -> int | None:
        """The number a / b of two sums whose weights are numbers in this ratio; else None."""
        above, below = self._weights(a), self._weights(b)
        if above.keys() != below.keys() or not all(below.values()):
            return None
        ratios = [above[node] / below[node] for node in below]
        alike = max(ratios) - min(ratios) <= _ROUNDING * abs(ratios[0])
        return self.number(ratios[0]) if alike else None

    def _weights(self, node: int) -> dict[int | None, float]:
        """Weights of the nodes in a sum, and its constant as that of None; a weight that is no number is NaN."""
        code, operands = self.nodes[node]
        if (value := self.value(node)) is not None:
            return {None: value}
        if code != ops.LINEAR:
            return {node: 1.0}
        total: dict[int | None, float] = {}
        for weight, term in self.terms(node):
            code, operands = self.nodes[weight]
            above, below = (self.value(operands[0]), self.value(operands[1])) if code == ops.QUOTIENT else (None, None)
            number = above / below if above is not None and below else self.value(weight)
            for each, share in self._weights(term).items():
                total[each] = total.get(each, 0.0) + share * (math.nan if number is None else number)
        return total

    def power(self, a: int, exponent: int) -> int:
        """a to the power of another node."""
        number = self.value(exponent)
        if number is None:
            if self.depends[exponent] == self.depends[a] == ops.CONSTANT:
                return self._general_power(a, exponent)
            if self.depends[exponent] == ops.CONSTANT:  # a whole power is smooth at zero, others are not
                raise NeedsValues(self._parameters_of(exponent))
            return self.function(ops.EXP, self.multiply(exponent, self.function(ops.LOG, a)))
        if number == 0.0:
            return self.number(1.0)
        twice = 2.0 * number
        if twice != round(twice) or abs(number) > 64:
            return self._general_power(a, exponent)
        if number < 0:
            return self.divide(self.number(1.0), self.power(a, self.number(-number)))
        result = None if number == math.floor(number) else self.function(ops.SQRT, a)
        whole = int(number)
        while whole:
            if whole & 1:
                result = a if result is None else self.multiply(result, a)
            whole >>= 1
            if whole:
                a = self.multiply(a, a)
        assert result is not None
        return result

    def _parameters_of(self, node: int) -> set[int]:
        """Numbers of the parameters that a constant depends on."""
        code, operands = self.nodes[node]
        if code == ops.PARAMETER:
            return {operands[0]}
        return set() if code in LEAVES else set().union(*map(self._parameters_of, operands))

    def _general_power(self, a: int, exponent: int) -> int:
        va, ve = self.value(a), self.value(exponent)
        if va is not None and ve is not None and va > 0:
            return self.number(va**ve)
        return self._weighted(ops.POWER, (a, exponent), lambda node: self.multiply(exponent, self.divide(node, a)))

    def function(self, code: int, a: int) -> int:
        """A function of one node."""
        value = self.value(a)
        if value is not None:
            try:
                return self.number(FUNCTIONS[code].value(value))
            except (ValueError, OverflowError):
                return self.number(math.nan)
        return self._weighted(code, (a,), lambda node: FUNCTIONS[code].weight(self, a, node))

    def step(self, a: int) -> int:
        """The sign of a node: 1 or -1."""
        value = self.value(a)
        if value is not None:
            return self.number(math.copysign(1.0, value) if value else 0.0)
        code, operands = self.nodes[a]
        if code == ops.STEP:
            return a
        if code == ops.LINEAR:
            weight = self.value(operands[0])
            if weight is not None and len(operands) == 2:  # one switch for every multiple of a switching function
                return self.multiply(self.number(math.copysign(1.0, weight)), self.step(operands[1]))
            if weight is not None and weight < 0:
                minus = self.number(-1.0)
                turned = self.linear([(self.multiply(minus, weight), node) for weight, node in self.terms(a)])
                return self.multiply(minus, self.step(turned))
        return self._new(ops.STEP, (a,))

    def floor(self, a: int) -> int:
        """The largest whole number below a node."""
        value = self.value(a)
        return self._new(ops.FLOOR, (a,)) if value is None else self.number(math.floor(value))

    def select(self, switch: int, above: int, below: int) -> int:
        """One node where another is positive, else a third."""
        sign = self.step(switch)
        value = self.value(sign)
        if above == below:
            return above
        if value is not None:
            return above if value > 0 else below
        code, operands = self.nodes[sign]
        if code == ops.LINEAR:  # minus a step
            return self._new(ops.SELECT, (operands[1], below, above))
        return self._new(ops.SELECT, (sign, above, below))


BUILDS: dict[str, Callable[..., int]] = {}
"""``BUILDS[name](graph, *operands) -> node``."""


def _enter(names: str, build: Callable[..., int]) -> None:
    """Let a function build the nodes of some ufuncs of numpy."""
    BUILDS.update({getattr(np, name).__name__: build for name in names.split()})


def _one(g: Graph) -> int:
    return g.number(1.0)


def _minus(g: Graph, a: int) -> int:
    return g.multiply(g.number(-1.0), a)


def _absolute(g: Graph, a: int) -> int:
    return g.select(a, a, _minus(g, a))


def _ceil(g: Graph, a: int) -> int:
    return _minus(g, g.floor(_minus(g, a)))


def _copysign(g: Graph, a: int, b: int) -> int:
    size = _absolute(g, a)
    return g.select(_minus(g, b), _minus(g, size), size)


def _arctan2(g: Graph, y: int, x: int) -> int:
    """In halves of the plane where one of the two quotients has no pole."""
    square = g.add(g.multiply(x, x), g.multiply(y, y), -1.0)
    minus = _minus(g, x)
    beside = g.function(ops.ATAN, g.divide(y, x))
    turned = g.add(beside, g.multiply(g.number(math.pi), g.step(y)))
    across = g.multiply(g.number(0.5 * math.pi), g.step(y))
    upright = g.add(across, g.function(ops.ATAN, g.divide(minus, y)))
    return g.select(square, g.select(x, beside, turned), upright)


for _code, _function in FUNCTIONS.items():
    _enter(_function.value.__name__, lambda g, a, code=_code: g.function(code, a))

_enter("add", Graph.add)
_enter("subtract", lambda g, a, b: g.add(a, b, -1.0))
_enter("multiply", Graph.multiply)
_enter("divide", Graph.divide)
_enter("power float_power", Graph.power)
_enter("negative", _minus)
_enter("positive conjugate", lambda g, a: a)
_enter("square", lambda g, a: g.multiply(a, a))
_enter("reciprocal", lambda g, a: g.divide(_one(g), a))
_enter("cbrt", lambda g, a: g.multiply(g.step(a), g.power(g.multiply(g.step(a), a), g.number(1.0 / 3.0))))
_enter("expm1", lambda g, a: g.add(g.function(ops.EXP, a), _one(g), -1.0))
_enter("log1p", lambda g, a: g.function(ops.LOG, g.add(a, _one(g))))
_enter("exp2", lambda g, a: g.function(ops.EXP, g.multiply(g.number(math.log(2.0)), a)))
_enter("log2", lambda g, a: g.divide(g.function(ops.LOG, a), g.number(math.log(2.0))))
_enter("log10", lambda g, a: g.divide(g.function(ops.LOG, a), g.number(math.log(10.0))))
_enter("arccos", lambda g, a: g.add(g.number(0.5 * math.pi), g.function(ops.ASIN, a), -1.0))
_enter("deg2rad radians", lambda g, a: g.multiply(g.number(math.pi / 180.0), a))
_enter("rad2deg degrees", lambda g, a: g.multiply(g.number(180.0 / math.pi), a))
_enter("absolute fabs", _absolute)
_enter("sign", Graph.step)
_enter("copysign", _copysign)
_enter("heaviside", lambda g, a, b: g.select(a, _one(g), g.number(0.0)))
_enter("maximum fmax", lambda g, a, b: g.select(g.add(a, b, -1.0), a, b))
_enter("minimum fmin", lambda g, a, b: g.select(g.add(a, b, -1.0), b, a))
# Equal nodes have the difference 0, whose sign is not positive.
_enter("greater", lambda g, a, b: g.select(g.add(a, b, -1.0), _one(g), g.number(0.0)))
_enter("greater_equal", lambda g, a, b: g.select(g.add(b, a, -1.0), g.number(0.0), _one(g)))
_enter("less", lambda g, a, b: g.select(g.add(b, a, -1.0), _one(g), g.number(0.0)))
_enter("less_equal", lambda g, a, b: g.select(g.add(a, b, -1.0), g.number(0.0), _one(g)))
_enter("logical_not invert", lambda g, a: g.add(_one(g), a, -1.0))
_enter("logical_and bitwise_and", Graph.multiply)
_enter("logical_or bitwise_or", lambda g, a, b: g.add(g.add(a, b), g.multiply(a, b), -1.0))
_enter("floor", Graph.floor)
_enter("ceil", _ceil)
_enter("trunc", lambda g, a: g.select(a, g.floor(a), _ceil(g, a)))
_enter("floor_divide", lambda g, a, b: g.floor(g.divide(a, b)))
_enter("remainder", lambda g, a, b: g.add(a, g.multiply(b, g.floor(g.divide(a, b))), -1.0))
_enter("hypot", lambda g, a, b: g.function(ops.SQRT, g.add(g.multiply(a, a), g.multiply(b, b))))
_enter("arctan2", _arctan2)
