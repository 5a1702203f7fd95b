"""The elementary functions of numpy as operations of a graph, by the name of their ufunc."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.graph import FUNCTIONS, Graph

BUILDS: dict[str, Callable[..., int]] = {}
"""``BUILDS[name](graph, *operands) -> node``."""


def _builds(*names: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    def register(build: Callable[..., int]) -> Callable[..., int]:
        BUILDS.update({getattr(np, name).__name__: build for name in names})
        return build

    return register


def _one(g: Graph) -> int:
    return g.number(1.0)


for _code, _function in FUNCTIONS.items():
    _builds(_function.value.__name__)(lambda g, a, code=_code: g.function(code, a))

_builds("add")(Graph.add)
_builds("subtract")(lambda g, a, b: g.add(a, b, -1.0))
_builds("multiply")(Graph.multiply)
_builds("divide")(Graph.divide)
_builds("power", "float_power")(Graph.power)
_builds("negative")(lambda g, a: g.multiply(g.number(-1.0), a))
_builds("positive", "conjugate")(lambda g, a: a)
_builds("square")(lambda g, a: g.multiply(a, a))
_builds("reciprocal")(lambda g, a: g.divide(_one(g), a))
_builds("cbrt")(lambda g, a: g.multiply(g.step(a), g.power(g.multiply(g.step(a), a), g.number(1.0 / 3.0))))
_builds("expm1")(lambda g, a: g.add(g.function(ops.EXP, a), _one(g), -1.0))
_builds("log1p")(lambda g, a: g.function(ops.LOG, g.add(a, _one(g))))
_builds("exp2")(lambda g, a: g.function(ops.EXP, g.multiply(g.number(math.log(2.0)), a)))
_builds("log2")(lambda g, a: g.divide(g.function(ops.LOG, a), g.number(math.log(2.0))))
_builds("log10")(lambda g, a: g.divide(g.function(ops.LOG, a), g.number(math.log(10.0))))
_builds("arccos")(lambda g, a: g.add(g.number(0.5 * math.pi), g.function(ops.ASIN, a), -1.0))
_builds("deg2rad", "radians")(lambda g, a: g.multiply(g.number(math.pi / 180.0), a))
_builds("rad2deg", "degrees")(lambda g, a: g.multiply(g.number(180.0 / math.pi), a))
_builds("absolute", "fabs")(lambda g, a: g.select(a, a, g.multiply(g.number(-1.0), a)))
_builds("sign")(Graph.step)
_builds("heaviside")(lambda g, a, b: g.select(a, _one(g), g.number(0.0)))
_builds("maximum", "fmax")(lambda g, a, b: g.select(g.add(a, b, -1.0), a, b))
_builds("minimum", "fmin")(lambda g, a, b: g.select(g.add(a, b, -1.0), b, a))
_builds("greater", "greater_equal")(lambda g, a, b: g.select(g.add(a, b, -1.0), _one(g), g.number(0.0)))
_builds("less", "less_equal")(lambda g, a, b: g.select(g.add(a, b, -1.0), g.number(0.0), _one(g)))
_builds("logical_not", "invert")(lambda g, a: g.add(_one(g), a, -1.0))
_builds("logical_and", "bitwise_and")(Graph.multiply)
_builds("logical_or", "bitwise_or")(lambda g, a, b: g.add(g.add(a, b), g.multiply(a, b), -1.0))
_builds("floor")(Graph.floor)
_builds("trunc")(lambda g, a: g.select(a, g.floor(a), _ceil(g, a)))
_builds("floor_divide")(lambda g, a, b: g.floor(g.divide(a, b)))
_builds("hypot")(lambda g, a, b: g.function(ops.SQRT, g.add(g.multiply(a, a), g.multiply(b, b))))
_builds("copysign")(lambda g, a, b: g.multiply(g.select(a, a, g.multiply(g.number(-1.0), a)), g.step(b)))


@_builds("ceil")
def _ceil(g: Graph, a: int) -> int:
    return g.multiply(g.number(-1.0), g.floor(g.multiply(g.number(-1.0), a)))


@_builds("remainder")
def _remainder(g: Graph, a: int, b: int) -> int:
    return g.add(a, g.multiply(b, g.floor(g.divide(a, b))), -1.0)


@_builds("arctan2")
def _arctan2(g: Graph, y: int, x: int) -> int:
    """In halves of the plane where one of the two quotients has no pole."""
    square = g.add(g.multiply(x, x), g.multiply(y, y), -1.0)
    minus = g.multiply(g.number(-1.0), x)
    beside = g.function(ops.ATAN, g.divide(y, x))
    turned = g.add(beside, g.multiply(g.number(math.pi), g.step(y)))
    across = g.multiply(g.number(0.5 * math.pi), g.step(y))
    upright = g.add(across, g.function(ops.ATAN, g.divide(minus, y)))
    return g.select(square, g.select(x, beside, turned), upright)
