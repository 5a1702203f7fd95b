"""A second program for branches: orbits by Newton's method, all crossings of the unit circle between two of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from own_flow import METHOD, Terms, flow, packed

Array = NDArray[np.float64]

FINE, COARSE = 1e-13, 1e-12
"""Tolerances of the flow; what two of them differ by is the error."""
_ROUNDS = 12
_SOLVED = 1e-11  # of the sizes: the last correction of an orbit
_ON = 1e-7  # off the circle: nearer, a multiplier is on it
_ROUND = 1e-14  # of what a return magnifies: an orbit beside a point where branches meet is no better
_NODES = 8  # of a segment
_DEEPER = 2  # times that a touch of the circle is looked at with finer nodes
_BESIDE = 1e-4  # of a segment: where rates are taken at a crossing
_BENT = 0.35  # of a segment: an orbit so far from what its ends foresee lies on another curve


class NoOrbit(Exception):
    """No orbit was found by this program."""


@dataclass(frozen=True)
class Returned:
    """The image of a state after the period: derivatives by state and parameter, velocities at both ends, all in the
    sizes of the states."""

    off: Array
    matrix: Array
    by_parameter: Array
    first: Array
    last: Array
    crossings: int


@dataclass(frozen=True)
class Solved:
    """An orbit: state, parameter and period in their sizes, and the derivative of its return map."""

    z: Array
    matrix: Array
    returned: Returned
    tangent: Array

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Eigenvalues of the return map; where time does not enter, zero for the motion itself."""
        return np.linalg.eigvals(self.matrix).astype(np.complex128)


class Orbits:
    """The orbits of a system, each of a multiple of its period.

    Parameters
    ----------
    system
        As a list of terms.
    sizes, scale, time
        Of the states, of the parameter, and of the period where it is unknown.
    periods
        How many periods of a driven system an orbit takes.
    """

    def __init__(self, system: Terms, sizes: Array, scale: float, time: float, periods: int) -> None:
        self.system, self.sizes, self.scale, self.time = system, np.asarray(sizes, float), scale, time
        self.periods, self.n, self.free = periods, system.n, system.period is None
        self._packed = packed(system)
        ratios = (self.sizes[:, None] / self.sizes).ravel()
        self._floor = np.concatenate([self.sizes, ratios, self.sizes / scale])

    def z(self, x: Array, p: float, period: float | None) -> Array:
        """A point in the sizes; the period is its last entry where it is unknown."""
        tail = [p / self.scale] + ([float(period or self.time) / self.time] if self.free else [])
        return np.append(np.asarray(x) / self.sizes, tail)

    def value(self, z: Array) -> float:
        """The parameter."""
        return float(z[self.n] * self.scale)

    def duration(self, z: Array) -> float:
        """Of an orbit."""
        return float(z[-1] * self.time) if self.free else float(self.system.period or 0.0) * self.periods

    def state_after(self, z: Array, part: float) -> Array:
        """The state in the sizes after a part of the period."""
        y = z[: self.n] * self.sizes
        end = part * self.duration(z)
        if flow(y, end, self.n, self.value(z), self._packed, self._floor, FINE, METHOD)[0] < 0:
            raise NoOrbit("the flow did not end")
        return y / self.sizes

    def returned(self, z: Array, tolerance: float = FINE) -> Returned:
        """The return of a point."""
        n, p = self.n, self.value(z)
        x = z[:n] * self.sizes
        y = np.concatenate([x, np.eye(n).ravel(), np.zeros(n)])
        steps, crossings = flow(y, self.duration(z), n, p, self._packed, self._floor, tolerance, METHOD)
        if steps < 0 or not np.isfinite(y).all():
            raise NoOrbit("the flow did not end")
        first, last = np.zeros(n), np.zeros(n)
        if self.free:
            first, last = self._slopes(x, p), self._slopes(y[:n], p)
        matrix = y[n : n + n * n].reshape(n, n) * self.sizes / self.sizes[:, None]
        by_parameter = y[n + n * n :] * self.scale / self.sizes
        return Returned((y[:n] - x) / self.sizes, matrix, by_parameter, first, last, crossings)

    def _slopes(self, x: Array, p: float) -> Array:
        """The right-hand side at time 0, times the unit of time, in the sizes."""
        rhs: Any = self._packed
        out = np.zeros(self.n)
        guards = rhs[7] @ x - rhs[8] - rhs[9] * p
        for k, i in enumerate(rhs[0]):
            side = int(rhs[6][k])
            if side and (guards[abs(side) - 1] > 0.0) != (side > 0):
                continue
            out[i] += (rhs[1][k] + rhs[2][k] * p) * np.prod(x ** rhs[3][k]) * np.cos(rhs[5][k] if rhs[4][k] else 0.0)
        return out * self.time / self.sizes

    def solved(self, guess: Array, normal: Array, tolerance: float = FINE) -> Solved:
        """The orbit in the plane through a guess with a normal in (state, parameter), by Newton's method.

        Raises
        ------
        NoOrbit
            If it does not converge.
        """
        n, z, moved = self.n, guess.copy(), np.inf
        phase = self._slopes(guess[:n] * self.sizes, self.value(guess)) if self.free else np.zeros(n)
        for _ in range(_ROUNDS):
            here = self.returned(z, tolerance)
            rows = self._rows(here, phase)
            full = np.vstack([rows, np.append(normal, [0.0] if self.free else [])])
            off = np.concatenate([here.off, [phase @ (z[:n] - guess[:n])] if self.free else []])
            right = np.append(off, normal @ (z - guess)[: n + 1])
            try:
                step = np.linalg.solve(full, right)
            except np.linalg.LinAlgError:
                raise NoOrbit("singular") from None
            before, moved = moved, float(np.abs(step).max())
            settled = float(np.abs(right).max()) < _ROUND * (1.0 + float(np.abs(rows).max()))
            if not np.isfinite(moved) or moved > 1e3:
                raise NoOrbit("Newton's method diverges")
            z = z - step
            if moved < _SOLVED or (moved < 1e-5 and (settled or (moved < 1e-8 and moved > 0.3 * before))):
                break
        else:
            raise NoOrbit(f"Newton's method does not converge: {moved:.1e}")
        return self.finished(z, normal, tolerance)

    def finished(self, z: Array, normal: Array, tolerance: float = FINE) -> Solved:
        """A point with its matrix and the tangent there, along a normal."""
        here = self.returned(z, tolerance)
        phase = here.first
        rows = self._rows(here, phase)
        tangent = np.linalg.svd(rows)[2][-1]
        tangent = tangent * (np.sign(normal @ tangent[: self.n + 1]) or 1.0)
        matrix = here.matrix
        if self.free:
            matrix = matrix - np.outer(here.last, phase @ matrix) / (phase @ here.last)
        return Solved(z, matrix, here, tangent)

    def _rows(self, here: Returned, phase: Array) -> Array:
        rows = np.column_stack([here.matrix - np.eye(self.n), here.by_parameter])
        if not self.free:
            return rows
        return np.vstack([np.column_stack([rows, here.last]), np.concatenate([phase, [0.0, 0.0]])])

    def at_value(self, x: Array, p: float, period: float | None = None) -> Solved:
        """The orbit at a value of the parameter."""
        return self.solved(self.z(x, p, period), np.append(np.zeros(self.n), 1.0))


def real_roots(polynomial: np.polynomial.Polynomial, within: float) -> list[float]:
    """Its real roots up to a distance from zero."""
    roots = np.asarray(polynomial.roots(), dtype=np.complex128)
    return [float(each.real) for each in roots if abs(each.imag) < 1e-9 * within and abs(each) < within]


def tests(solved: Solved) -> Array:
    """What passes zero where a multiplier is +1, -1, or a pair is on the circle."""
    nu = solved.multipliers
    first, second = np.triu_indices(nu.size, 1)
    with np.errstate(all="ignore"):
        pairs = (nu[first] * nu[second] - 1.0).prod().real
        return np.array([(nu - 1.0).prod().real, (nu + 1.0).prod().real, float(pairs)])


def outside(solved: Solved) -> tuple[int, bool]:
    """How many multipliers are outside the circle, and whether that is sure."""
    away = np.abs(solved.multipliers) - 1.0
    return int((away > 0.0).sum()), bool((np.abs(away) > _ON).all())


@dataclass(frozen=True)
class Crossing:
    """A crossing of the circle: which test passes zero (0: +1, 1: -1, 2: a pair), the parameter and its error, whether
    the curve turns back in the parameter there."""

    test: int
    value: float
    error: float
    place: float
    fold: bool = False


class Segment:
    """What happens between two orbits of a branch, by this program alone."""

    def __init__(self, orbits: Orbits, start: Array, end: Array) -> None:
        self.orbits, self.start, self.end = orbits, start, end
        n = orbits.n
        chord = (end - start)[: n + 1]
        self.length = float(np.linalg.norm(chord))
        self.normal = chord / self.length
        self._known: dict[tuple[float, float], Solved] = {}
        self._tangents: tuple[Array, Array] | None = None

    def at(self, place: float, tolerance: float = FINE) -> Solved:
        """The orbit in the plane across the chord at a part of its length."""
        key = place, tolerance
        if key not in self._known:
            self._known[key] = self.orbits.solved(self._foreseen(place), self.normal, tolerance)
        return self._known[key]

    def foresee(self, start: bool = True) -> None:
        """Take the tangents at both ends for what is foreseen between; a start where branches meet has none."""
        chord = self.end - self.start
        ends = []
        for point, has in ((self.start, start), (self.end, True)):
            tangent = chord
            if has:
                own = self.orbits.finished(point, self.normal).tangent
                along = float(own[: self.orbits.n + 1] @ self.normal)
                tangent = own * self.length / along if along > 0.3 else chord
            ends.append(tangent)
        self._tangents = ends[0], ends[1]

    def _foreseen(self, t: float) -> Array:
        chord = self.end - self.start
        if self._tangents is None:
            return np.asarray(self.start + t * chord)
        a, b = self._tangents
        return np.asarray(self.start + t * t * (3 - 2 * t) * chord + t * (1 - t) ** 2 * a - t * t * (1 - t) * b)

    def strays(self, place: float) -> float:
        """How far an orbit is from what the ends foresee, of the length."""
        n = self.orbits.n
        return float(np.linalg.norm((self.at(place).z - self._foreseen(place))[: n + 1])) / self.length

    def crossings(self, also: list[float], low: float) -> list[Crossing]:
        """All crossings, with nodes on both sides of some places as well.

        Raises
        ------
        NoOrbit
            If an orbit between is not found, or lies on another curve.
        """
        inner = sorted(place for place in also if low < place < 1.0)
        nodes = {low, 1.0, *np.linspace(low, 1.0, _NODES + 1).tolist()}
        for place in inner:
            gap = min([abs(place - other) for other in (*inner, low, 1.0) if other != place] + [0.04])
            nodes |= {place - 0.3 * gap, place + 0.3 * gap}
        places = sorted(place for place in nodes if not any(abs(place - each) < 1e-12 for each in inner))
        for place in places:
            if self.strays(place) > _BENT:
                raise NoOrbit("an orbit between lies on another curve")
        for _ in range(_DEEPER):
            finer = self._touches(places)
            if not finer:
                break
            places = sorted({*places, *finer})
        found: list[Crossing] = []
        for a, b in zip(places, places[1:], strict=False):
            found += self._between(a, b)
        return found

    def _touches(self, places: list[float]) -> list[float]:
        """Places at which a test may touch zero between three nodes: by the parabola through them."""
        found = []
        values = np.array([tests(self.at(place)) for place in places])
        for i in range(1, len(places) - 1):
            for f in values.T:
                three = f[i - 1 : i + 2]
                if not (np.sign(three) == np.sign(three[1])).all() or abs(three[1]) > abs(three).min():
                    continue
                fit = np.polyfit(np.array(places[i - 1 : i + 2]) - places[i], three / three[1], 2)
                lowest = fit[2] - fit[1] ** 2 / (4 * fit[0]) if fit[0] > 0 else 1.0
                if lowest < 0.4:
                    found += [0.5 * (places[i - 1] + places[i]), 0.5 * (places[i] + places[i + 1])]
        return found

    def _between(self, a: float, b: float) -> list[Crossing]:
        left, right = self.at(a), self.at(b)
        before, after = tests(left), tests(right)
        (many, sure), (now, known) = outside(left), outside(right)
        found = [self._located(i, a, b) for i in (0, 1) if before[i] * after[i] < 0.0]
        if sure and known and abs(now - many) != len(found) and (abs(now - many) - len(found)) % 2 == 0:
            # Two that cross as one, or a pair: what the signs of the others do not tell.
            if before[2] * after[2] < 0.0:
                found.append(self._located(2, a, b))
            elif b - a > 2e-3:
                middle = 0.5 * (a + b) + 1e-3 * (b - a)
                return self._between(a, middle) + self._between(middle, b)
            else:
                value = self.orbits.value(0.5 * (left.z + right.z))
                found.append(Crossing(2, value, abs(self.orbits.value(right.z - left.z)), 0.5 * (a + b)))
        return found

    def _located(self, test: int, a: float, b: float) -> Crossing:
        """A crossing between two places, as closely as this program can."""

        def value(place: float, tolerance: float = FINE) -> float:
            return float(tests(self.at(place, tolerance))[test])

        root = float(brentq(value, a, b, xtol=1e-11))
        beside = _BESIDE if min(root - a, b - root) > 3 * _BESIDE else 0.2 * min(root - a, b - root)
        beside = max(beside, 1e-7)
        sides = np.array([-2.0, -1.0, 1.0, 2.0]) * beside
        nodes = [self.at(root + side) for side in sides]
        values = np.array([tests(each)[test] for each in nodes])
        # Where branches meet, orbits are uncertain near the root: it is that of a polynomial through its sides.
        fit = np.polynomial.Polynomial.fit(sides, values, 3)
        rate = float(fit.deriv()(0.0))
        shift = -float(fit(0.0)) / rate if rate else 0.0
        shift = shift if abs(shift) < beside else 0.0
        line = np.polyfit(sides[1:3], values[1:3], 1)
        wrong = abs(values[1] - value(root + sides[1], COARSE)) + abs(values[2] - value(root + sides[2], COARSE))
        uncertain = abs(shift) + 0.1 * abs(-line[1] / line[0] - shift if line[0] else beside)
        uncertain += wrong / abs(rate) if rate else beside
        course = [self.orbits.value(each.z) for each in nodes]
        slope = (course[2] - course[1]) / (2 * beside)
        curvature = (course[3] - course[2] - course[1] + course[0]) / (3.0 * beside**2)
        coarse = self.orbits.value(self.at(root + sides[2], COARSE).z)
        fold = test == 0 and self._turns(root, beside, nodes)
        at_root = np.polynomial.Polynomial.fit(sides, course, 3)
        place = shift
        if fold:  # its value does not depend on where exactly the curve turns
            turns = real_roots(at_root.deriv(), 2 * beside)
            place = min(turns, key=abs) if turns else shift
        error = abs(slope) * (0.0 if fold else uncertain) + abs(curvature) * uncertain**2
        error += 2.0 * abs(coarse - course[2]) + 1e-14 * abs(course[1])
        return Crossing(test, float(at_root(place)), float(error), root, fold)

    def _turns(self, root: float, beside: float, nodes: list[Solved]) -> bool:
        n = self.orbits.n
        return bool(nodes[0].tangent[n] * nodes[3].tangent[n] < 0.0)
