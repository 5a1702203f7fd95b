"""A second program for orbits: systems that are lists of terms, and their flow with its derivatives.

It shares no code with chilopod. The right-hand side is a sum of monomials, each with a coefficient a + b p of the
parameter p, a cosine of time if it is driven, and a side of a surface if it acts on one side alone. State, its
derivative by the state at time 0, and that by the parameter are integrated together by the method DOP853 with the
coefficients that scipy has.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import DOP853

Array = NDArray[np.float64]
Rhs = Callable[..., list[Any]]

_A, _B, _C = np.ascontiguousarray(DOP853.A[:12, :12]), np.ascontiguousarray(DOP853.B), np.ascontiguousarray(DOP853.C)
_E3, _E5 = np.ascontiguousarray(DOP853.E3), np.ascontiguousarray(DOP853.E5)
_STEPS = 400_000
_NEAR = 1e-9  # of a guard's size: nearer to the surface its velocity tells the side


@dataclass(frozen=True)
class Term:
    """A term (at_zero + slope p) x^powers cos(turns t + phase) of one equation, on one side of a surface or on both."""

    equation: int
    at_zero: float
    powers: tuple[int, ...]
    slope: float = 0.0
    turns: float = 0.0
    phase: float = 0.0
    side: int = 0  # +-(number of the surface + 1)


@dataclass(frozen=True)
class Surface:
    """The surface normal x = at_zero + slope p, which resets the state to matrix x if there is a matrix."""

    normal: tuple[float, ...]
    at_zero: float
    slope: float = 0.0
    direction: int = 0
    matrix: tuple[tuple[float, ...], ...] | None = None


@dataclass(frozen=True)
class Terms:
    """A system as a list of terms; period None: it does not depend on time."""

    n: int
    terms: tuple[Term, ...]
    period: float | None
    surfaces: tuple[Surface, ...] = ()
    sizes: tuple[float, ...] = field(default=())

    def scaled(self, sizes: Array, time: float, parameter: float) -> Terms:
        """The same system in other units: x = u / sizes, t = u / time, p = u / parameter."""
        new = tuple(
            replace(
                term,
                at_zero=term.at_zero * self._factor(term, sizes, time),
                slope=term.slope * self._factor(term, sizes, time) / parameter,
                turns=term.turns / time,
            )
            for term in self.terms
        )
        surfaces = tuple(
            replace(
                each,
                normal=tuple(float(a / s) for a, s in zip(each.normal, sizes, strict=True)),
                slope=each.slope / parameter,
                matrix=None
                if each.matrix is None
                else tuple(map(tuple, (np.array(each.matrix) * sizes[:, None] / sizes).tolist())),
            )
            for each in self.surfaces
        )
        own = tuple((np.array(self.sizes or (1.0,) * self.n) * sizes).tolist())
        return Terms(self.n, new, None if self.period is None else self.period * time, surfaces, own)

    @staticmethod
    def _factor(term: Term, sizes: Array, time: float) -> float:
        return float(sizes[term.equation] / np.prod(sizes ** np.array(term.powers)) / time)

    def rhs(self) -> Rhs:
        """As a function of plain Python."""
        terms, n, surfaces = self.terms, self.n, self.surfaces

        def rhs(t: Any, x: Any, p: float) -> list[Any]:
            sums: list[Any] = [0.0] * n
            guards = [guard(each)(t, x, p) for each in surfaces]
            for term in terms:
                product: Any = term.at_zero + term.slope * p
                for state, power in enumerate(term.powers):
                    for _ in range(power):
                        product = product * x[state]
                if term.turns:
                    product = product * np.cos(term.turns * t + term.phase)
                if term.side:
                    beyond = guards[abs(term.side) - 1]
                    product = np.where(beyond > 0.0 if term.side > 0 else beyond <= 0.0, product, 0.0)
                sums[term.equation] = sums[term.equation] + product
            return sums

        return rhs


def guard(surface: Surface) -> Callable[[Any, Any, float], Any]:
    """What passes zero where a state meets a surface."""

    def value(t: Any, x: Any, p: float) -> Any:
        found: Any = -(surface.at_zero + surface.slope * p)
        for state, weight in enumerate(surface.normal):
            if weight:
                found = found + weight * x[state]
        return found

    return value


def packed(system: Terms) -> tuple[Any, ...]:
    """A system as arrays, for compiled code."""
    terms, n, m = system.terms, system.n, len(system.surfaces)
    one = np.eye(n)
    matrices = [one if s.matrix is None else np.array(s.matrix, dtype=float) for s in system.surfaces]
    return (
        np.array([t.equation for t in terms]),
        np.array([t.at_zero for t in terms], dtype=float),
        np.array([t.slope for t in terms], dtype=float),
        np.array([t.powers for t in terms], dtype=np.int64).reshape(len(terms), n),
        np.array([t.turns for t in terms], dtype=float),
        np.array([t.phase for t in terms], dtype=float),
        np.array([t.side for t in terms], dtype=np.int64),
        np.array([s.normal for s in system.surfaces], dtype=float).reshape(m, n),
        np.array([s.at_zero for s in system.surfaces], dtype=float),
        np.array([s.slope for s in system.surfaces], dtype=float),
        np.array([s.direction if s.matrix is not None else 0 for s in system.surfaces], dtype=np.int64),
        np.array([s.matrix is not None for s in system.surfaces], dtype=np.int64),
        np.array(matrices, dtype=float).reshape(m, n, n),
    )


@njit(cache=True)
def _slopes(t: float, y: Array, n: int, p: float, s: Any, mode: Any, out: Array) -> None:
    """Derivative of state, matrix (n, n) and derivative by the parameter, one behind the other."""
    equation, at_zero, slope, powers, turns, phase, side = s[0], s[1], s[2], s[3], s[4], s[5], s[6]
    out[:] = 0.0
    jacobian = np.zeros((n, n))
    whole = y.size > n
    for k in range(equation.size):
        if side[k] != 0 and (mode[abs(side[k]) - 1] > 0) != (side[k] > 0):
            continue
        i = equation[k]
        driven = np.cos(turns[k] * t + phase[k]) if turns[k] != 0.0 else 1.0
        monomial = driven
        for j in range(n):
            for _ in range(powers[k, j]):
                monomial *= y[j]
        factor = at_zero[k] + slope[k] * p
        out[i] += factor * monomial
        if not whole:
            continue
        out[n + n * n + i] += slope[k] * monomial
        for j in range(n):
            if powers[k, j] > 0:
                rest = driven * powers[k, j]
                for other in range(n):
                    for _ in range(powers[k, other] - (1 if other == j else 0)):
                        rest *= y[other]
                jacobian[i, j] += factor * rest
    if whole:
        for i in range(n):
            for j in range(n):
                if jacobian[i, j] != 0.0:
                    for c in range(n):
                        out[n + i * n + c] += jacobian[i, j] * y[n + j * n + c]
                    out[n + n * n + i] += jacobian[i, j] * y[n + n * n + j]


@njit(cache=True)
def _step(
    t: float, y: Array, h: float, n: int, p: float, s: Any, mode: Any, k: Array, new: Array, methods: Any
) -> None:
    """One step; k[0] has the slopes at its start, k[12] will have those at its end."""
    a, b, c = methods[0], methods[1], methods[2]
    for stage in range(1, 12):
        new[:] = y
        for j in range(stage):
            if a[stage, j] != 0.0:
                weight = h * a[stage, j]
                for i in range(y.size):
                    new[i] += weight * k[j, i]
        _slopes(t + c[stage] * h, new, n, p, s, mode, k[stage])
    new[:] = y
    for j in range(12):
        if b[j] != 0.0:
            weight = h * b[j]
            for i in range(y.size):
                new[i] += weight * k[j, i]
    _slopes(t + h, new, n, p, s, mode, k[12])


@njit(cache=True)
def _wrong(h: float, k: Array, y: Array, new: Array, floor: Array, tolerance: float, methods: Any) -> float:
    """Estimated error of a step over what is allowed, as DOP853 has it."""
    e3, e5 = methods[3], methods[4]
    five = three = 0.0
    for i in range(y.size):
        allowed = tolerance * (floor[i] + max(abs(y[i]), abs(new[i])))
        a = b = 0.0
        for j in range(13):
            a += e5[j] * k[j, i]
            b += e3[j] * k[j, i]
        five += (a / allowed) ** 2
        three += (b / allowed) ** 2
    if five == 0.0 and three == 0.0:
        return 0.0
    return abs(h) * five / np.sqrt((five + 0.01 * three) * y.size)


@njit(cache=True)
def _beyond(g: int, y: Array, n: int, p: float, s: Any) -> float:
    found = -(s[8][g] + s[9][g] * p)
    for i in range(n):
        found += s[7][g, i] * y[i]
    return found


@njit(cache=True)
def _side(g: int, y: Array, n: int, p: float, s: Any, slopes: Array, floor: Array) -> int:
    """On which side of a surface a state is, or goes to if it lies in it."""
    value, size, velocity = _beyond(g, y, n, p, s), 0.0, 0.0
    for i in range(n):
        size += abs(s[7][g, i]) * (floor[i] + abs(y[i]))
        velocity += s[7][g, i] * slopes[i]
    if abs(value) > _NEAR * size:
        return 1 if value > 0.0 else -1
    return 1 if velocity > 0.0 else -1


@njit(cache=True)
def _dip(
    t: float, y: Array, h: float, g: int, n: int, p: float, s: Any, mode: Any, k: Array, new: Array, ms: Any
) -> float:
    """Part of a step after which a guard is on its other side, although both ends agree; 0 if there is none.

    The guard is looked at where its cubic over the step comes nearest to the surface, and where the slopes found there
    say that it does: a grazing orbit is beyond the surface for a tiny part of a step.
    """
    a, da, b, db = _beyond(g, y, n, p, s), 0.0, _beyond(g, new, n, p, s), 0.0
    for i in range(n):
        da += h * s[7][g, i] * k[0, i]
        db += h * s[7][g, i] * k[12, i]
    if da * mode[g] >= 0.0 or db * mode[g] <= 0.0:
        return 0.0
    low, high, u = 0.0, 1.0, 0.5
    for _ in range(60):  # the slope of the cubic rises from one end to the other
        u = 0.5 * (low + high)
        slope = 6.0 * (b - a) * u * (1.0 - u) + da * (1.0 - u) * (1.0 - 3.0 * u) + db * u * (3.0 * u - 2.0)
        low, high = (u, high) if slope * mode[g] < 0.0 else (low, u)
    low, high, found = 0.0, 1.0, 0.0
    for _ in range(4):
        _step(t, y, u * h, n, p, s, mode, k, new, ms)
        if _beyond(g, new, n, p, s) * mode[g] < 0.0:
            found = u
            break
        slope = 0.0
        for i in range(n):
            slope += h * s[7][g, i] * k[12, i]
        if slope * mode[g] < 0.0:
            low, da = u, slope
        else:
            high, db = u, slope
        u = low + (high - low) * da / (da - db)
    _step(t, y, h, n, p, s, mode, k, new, ms)
    return found


@njit(cache=True)
def _cross(g: int, y: Array, t: float, n: int, p: float, s: Any, mode: Any, before: Array, floor: Array) -> None:
    """Reset or switch the state at a surface in place, with the saltation of all derivatives."""
    matrix = s[12][g]
    x = y[:n].copy()
    y[:n] = matrix @ x
    state = y[:n].copy()
    after = np.empty(n)
    mode[g] = -mode[g]
    _slopes(t, state, n, p, s, mode, after)
    if s[11][g] == 1:
        for other in range(s[8].size):
            mode[other] = _side(other, y, n, p, s, after, floor)
        _slopes(t, state, n, p, s, mode, after)
    speed = 0.0
    for i in range(n):
        speed += s[7][g, i] * before[i]
    jump = matrix @ before[:n] - after
    if y.size == n:
        return
    for c in range(n + 1):
        column = np.empty(n)
        for i in range(n):
            column[i] = y[n + i * n + c] if c < n else y[n + n * n + i]
        along = 0.0 if c < n else -s[9][g]
        for i in range(n):
            along += s[7][g, i] * column[i]
        moved = matrix @ column - jump * (along / speed)
        for i in range(n):
            if c < n:
                y[n + i * n + c] = moved[i]
            else:
                y[n + n * n + i] = moved[i]


@njit(cache=True)
def _place(
    t: float, y: Array, h: float, g: int, n: int, p: float, s: Any, mode: Any, k: Array, new: Array, ms: Any
) -> float:
    """Length of the step that ends on a surface, by bisection sped up by secants."""
    a, b = 0.0, h
    _step(t, y, b, n, p, s, mode, k, new, ms)
    fa, fb = _beyond(g, y, n, p, s), _beyond(g, new, n, p, s)
    if fa * mode[g] <= 0.0:
        fa = mode[g] * abs(fb) * 1e-3  # it starts in the surface
    for i in range(80):
        middle = b - fb * (b - a) / (fb - fa) if i % 3 else 0.5 * (a + b)
        if not a < middle < b:
            middle = 0.5 * (a + b)
        _step(t, y, middle, n, p, s, mode, k, new, ms)
        value = _beyond(g, new, n, p, s)
        if value * mode[g] > 0.0:
            a, fa = middle, value
        else:
            b, fb = middle, value
        if b - a <= 4e-16 * (abs(t) + h) or value == 0.0:
            break
    _step(t, y, b, n, p, s, mode, k, new, ms)
    return b


@njit(cache=True)
def flow(y: Array, end: float, n: int, p: float, s: Any, floor: Array, tolerance: float, ms: Any) -> tuple[int, int]:
    """Integrate in place from time 0; returns the number of steps, negative if they were too many, and of crossings."""
    surfaces = s[8].size
    mode = np.ones(max(surfaces, 1), dtype=np.int64)
    k, new = np.empty((13, y.size)), np.empty(y.size)
    _slopes(0.0, y, n, p, s, mode, k[0])
    for g in range(surfaces):
        mode[g] = _side(g, y, n, p, s, k[0], floor)
    t, h, crossings, longest = 0.0, 1e-3 * end, 0, end / 30.0 if surfaces else end
    _slopes(t, y, n, p, s, mode, k[0])
    for count in range(_STEPS):
        if t >= end:
            return count, crossings
        h = min(h, longest, end - t)
        last = t + h >= end * (1.0 - 1e-15)
        _step(t, y, h, n, p, s, mode, k, new, ms)
        wrong = _wrong(h, k, y, new, floor, tolerance, ms)
        if not wrong <= 1.0:
            h *= max(0.2, 0.9 * wrong**-0.125) if wrong == wrong and wrong < 1e300 else 0.1
            if h < 1e-14 * end:
                return -count - 1, crossings
            continue
        hit, inner = -1, 0.0
        earliest = h
        for g in range(surfaces):
            side = 1 if _beyond(g, new, n, p, s) > 0.0 else -1
            if side != mode[g]:
                if s[11][g] == 1 and s[10][g] * mode[g] > 0:
                    mode[g] = side  # the surface acts on those that come from the other side
                    continue
                place = _place(t, y, h, g, n, p, s, mode, k, new, ms)
                if place <= earliest:
                    hit, earliest = g, place
                _step(t, y, h, n, p, s, mode, k, new, ms)
            elif h > 1e-9 * end:
                inner = max(inner, _dip(t, y, h, g, n, p, s, mode, k, new, ms))
        if inner > 0.0:
            h *= inner
            continue
        if hit >= 0:
            _step(t, y, earliest, n, p, s, mode, k, new, ms)
            before = k[12].copy()
            y[:] = new
            t += earliest
            _cross(hit, y, t, n, p, s, mode, before, floor)
            crossings += 1
            _slopes(t, y, n, p, s, mode, k[0])
            h = min(h, 1e-3 * end)
            continue
        t = end if last else t + h
        y[:] = new
        k[0] = k[12]
        h *= 5.0 if wrong < 1e-8 else min(5.0, 0.9 * wrong**-0.125)
    return -_STEPS, crossings


METHOD = (_A, _B, _C, _E3, _E5)
