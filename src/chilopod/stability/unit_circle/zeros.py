"""All zeros of an analytic function in an interval.

The interval is cut into pieces until the function is a polynomial of degree eight on every piece, or sixteen on a wide
one, to a small part of its size there (the idea of Chebfun: Battles & Trefethen, SIAM J. Sci. Comput. 25, 2004), or to
its own error. The polynomial cuts a piece into parts: some have a certain sign, and the function may vanish in the
narrow ones between them. These are doubtful. A doubtful part between opposite signs contains one zero, if the
polynomial is monotonic there and the function has these signs at both ends. Any other doubtful part, which may contain
no zero, two, or a double one, becomes a piece again, until it has a sign or is zero within its error. The zeros are
read from the final parts.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum, auto
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from chilopod.frozen import Array

DEGREE = 8
_NODES = np.cos(np.pi * np.arange(DEGREE, -1, -1) / DEGREE)

PLACES: Array = np.append(_NODES, [-0.618, 0.137])  # nodes of the polynomial, and two places of the comparison
FEW_PLACES: Array = _NODES[[0, 2, 4, 6, 8, 3, 5]]  # nodes of half the degree, and two of the others for the comparison
MORE_PLACES: Array = np.append(PLACES, np.cos(np.pi * (np.arange(DEGREE) + 0.5) / DEGREE))  # those of twice the degree
DENSE = np.linspace(-1.0, 1.0, 65)  # places where the polynomial is evaluated

Interval = tuple[float, float]
SignedLog = Callable[[Array], tuple[Array, Array]]
"""A function given as ``numpy.linalg.slogdet`` gives a determinant: signs, shape (k,), and logarithms of sizes, shape
(k,), so that no size is too small or too large; NaN where the function cannot be evaluated."""

_RESOLVED = 1e-4  # largest error of a piece's polynomial, relative to its largest value
_PROMISING = 1e-2  # largest error at which twice the degree resolves the piece: the error is about squared
_CLEAR = 4.0  # value, in errors, with a certain sign
_ROUNDING = 32.0 * float(np.finfo(float).eps)  # rounding of any polynomial, relative to its largest value
_NARROW = 0.05  # widest useful part without a certain sign, relative to its piece
_DEEP = 2.0**-4  # widest piece, relative to the interval, whose function error is computed
_HOLE = 2.0**-8  # width of a piece where the function exists in part, relative to the interval
_ROUGH = 2.0**-34  # least width of a piece that is not a polynomial, relative to the interval
_FINEST = 1e-12  # width of a part in which zeros are not separated, relative to the interval
_ULPS = 256.0  # width of the finest piece in units in the last place
_BESIDE = 1e-6  # distance from a zero, relative to the interval, at which signs also give a rate of change

_WITHIN, _STEADY = np.linspace(0.0, 1.0, 5), 0.25  # places in a part, and least relative slope for a simple zero
_REAL = 1e-6  # largest imaginary part of a place where a level is just reached

_DEGREES = np.arange(2.0 * DEGREE + 1.0)
_BULGE = _DEGREES**2 * (_DEGREES**2 - 1.0) / 3.0 * (DENSE[1] - DENSE[0]) ** 2 / 8.0
"""Largest bulge of each Chebyshev polynomial between neighbours of ``DENSE``, by its largest second derivative."""


class Zeros(NamedTuple):
    """Intervals in which a search found something, in order."""

    changes: tuple[Interval, ...]  # opposite signs at the ends, one zero each; (a, a) for a zero at an end
    touches: tuple[Interval, ...]  # a zero of even order, or an uncertain sign, between equal signs
    unresolved: tuple[Interval, ...]  # not polynomial: the function is not smooth there, or the budget was spent
    missing: tuple[Interval, ...]  # the function cannot be evaluated, or only in part
    spent: bool  # the budget ended the search


def find_zeros(
    function: SignedLog,
    low: float,
    high: float,
    *,
    error: Callable[[Array], Array] | None = None,
    left: Callable[[], int] | None = None,
    skip: Callable[[float, float], bool] | None = None,
) -> Zeros:
    """All zeros of an analytic function, which need not be scaled, in an interval.

    Below its ``error``, given as a logarithm, shape (k,), a value is zero. When the budget of values is spent
    (``left``, by default 20 000 in all), the widest pieces have been searched, and the changes of sign so far are
    reported. Zeros between two values for which ``skip`` is true are ignored.
    """
    search = _Search(function, error, skip, low, high)
    room_left = left if left is not None else lambda: 20_000 - len(search.signs)
    pieces = [(low, high)]
    while pieces:
        room = max(room_left(), 0) // (2 * PLACES.size)
        pieces.sort(key=lambda piece: 0.5 * piece[0] - 0.5 * piece[1])  # the widest first
        if room == 0:
            search.put([_Part(a, b, _Kind.ROUGH) for a, b in pieces])
            search.spent = True
            break
        search.spent |= room < len(pieces)
        pieces = pieces[room:] + search.look(pieces[:room])
        pieces = pieces or search.doubtful(room_left())
    return search.result()


class _Kind(Enum):
    """Knowledge of a function on a part of the interval."""

    SIGN = auto()  # it has one sign
    DOUBT = auto()  # it may vanish, and the polynomial is monotonic
    BENT = auto()  # it may vanish, and the polynomial turns
    ZERO = auto()  # it is zero within its error
    ROUGH = auto()  # it is not a polynomial
    MISSING = auto()  # it cannot be evaluated
    SKIPPED = auto()  # its zeros are ignored


class _Part(NamedTuple):
    """A part of the interval, with its sign, if certain, or the logarithm of the polynomial's error."""

    a: float
    b: float
    kind: _Kind
    sign: float = 0.0
    wrong: float = -np.inf


_OPEN = (_Kind.DOUBT, _Kind.BENT)


@dataclass
class _Search:
    function: SignedLog
    error: Callable[[Array], Array] | None
    skip: Callable[[float, float], bool] | None
    low: float
    high: float
    spent: bool = False
    signs: dict[float, float] = field(default_factory=dict)  # wherever the function was evaluated
    parts: list[_Part] = field(default_factory=list)  # in order

    def put(self, parts: list[_Part]) -> None:
        """Replace the known parts there."""
        for part in parts:
            before = [each._replace(b=min(each.b, part.a)) for each in self.parts if each.a < part.a]
            after = [each._replace(a=max(each.a, part.b)) for each in self.parts if each.b > part.b]
            self.parts = [*before, part, *after]

    def look(self, pieces: list[Interval]) -> list[Interval]:
        """Search some pieces together; return the remaining pieces."""
        left: list[Interval] = []
        for wanted in (PLACES, MORE_PLACES):
            places = np.array([places_in(a, b, wanted) for a, b in pieces]).reshape(-1, wanted.size)
            signs, logs = (part.reshape(places.shape) for part in self._ask(places.ravel()))
            promising = []
            for (a, b), row_signs, row_logs in zip(pieces, signs, logs, strict=True):
                parts = self._parts(a, b, row_signs, row_logs)
                if parts is None:
                    promising.append((a, b))
                elif parts:
                    self.put(parts)
                else:
                    middle = 0.5 * a + 0.5 * b
                    left += [(a, middle), (middle, b)]
            if not promising:
                break
            pieces = promising
        return left

    def _ask(self, places: Array) -> tuple[Array, Array]:
        signs, logs = self.function(places)
        self.signs.update(zip(places.tolist(), signs.tolist(), strict=True))
        return signs, logs

    def _fine(self, a: float, b: float, part: float) -> bool:
        """True if a piece is too narrow for a cut."""
        least = max(part * (0.5 * self.high - 0.5 * self.low), 0.5 * _ULPS * float(np.spacing(max(abs(a), abs(b)))))
        return 0.5 * b - 0.5 * a <= least

    def _parts(self, a: float, b: float, signs: Array, logs: Array) -> list[_Part] | None:
        """Parts of a piece; None if more places promise them, an empty list if the piece must be cut in two."""
        absent = np.isnan(signs) | np.isnan(logs) | (logs == np.inf)
        if absent.any():
            return [_Part(a, b, _Kind.MISSING)] if absent.all() or self._fine(a, b, _HOLE) else []
        reference = float(logs.max())
        if reference == -np.inf:
            return [_Part(a, b, _Kind.ZERO)]
        coefficients, off, dense = interpolated(signs * np.exp(logs - reference), MORE_PLACES[: logs.size])
        wrong = max(float(off), _ROUNDING)
        if max(dense.min(), -dense.max()) > _CLEAR * wrong + float(np.abs(coefficients) @ _BULGE[: coefficients.size]):
            return [_Part(a, b, _Kind.SIGN, float(np.sign(dense[0])))]
        deep = self._fine(a, b, _DEEP)
        if self.skip is not None and deep and self.skip(a, b):
            return [_Part(a, b, _Kind.SKIPPED)]
        parts = self._cut(a, b, coefficients, wrong, reference)
        if wrong <= _RESOLVED and not any(_wide(part, a, b) for part in parts):
            return parts
        if not deep and signs.size == PLACES.size and wrong <= _PROMISING:
            return None
        if self.error is not None and deep:
            noise = float(np.exp(min(self.error(places_in(a, b, PLACES)).max() - reference, 0.0)))
            if _CLEAR * noise >= 1.0:
                return [_Part(a, b, _Kind.ZERO)]
            if wrong <= _CLEAR * noise:
                # A wide part does not become narrower on a smaller piece.
                parts = self._cut(a, b, coefficients, _CLEAR * noise, reference)
                return [part._replace(wrong=-np.inf) if _wide(part, a, b) else part for part in parts]
        if self._fine(a, b, _ROUGH):
            return [_Part(a, b, _Kind.ZERO if self._fine(a, b, _FINEST) else _Kind.ROUGH)]
        return []

    def _cut(self, a: float, b: float, coefficients: Array, wrong: float, reference: float) -> list[_Part]:
        """A piece with a polynomial, cut where the value's size makes a sign certain."""
        level = _CLEAR * wrong
        ends = np.concatenate([[-1.0], _levels(coefficients, level), [1.0]])
        values = chebyshev.chebval(0.5 * ends[1:] + 0.5 * ends[:-1], coefficients)
        signs = np.where(np.abs(values) > level, np.sign(values), 0.0)
        borders = np.concatenate([[0], np.flatnonzero(np.diff(signs)) + 1, [signs.size]])
        parts = []
        for i, j in itertools.pairwise(borders.tolist()):
            start, end = places_in(a, b, ends[[i, j]]).tolist()
            if signs[i]:
                parts.append(_Part(start, end, _Kind.SIGN, float(signs[i])))
                continue
            slopes = chebyshev.chebval(ends[i] + _WITHIN * (ends[j] - ends[i]), chebyshev.chebder(coefficients))
            steady = slopes.min() * slopes.max() > 0.0 and np.abs(slopes).min() > _STEADY * np.abs(slopes).max()
            kind = _Kind.DOUBT if steady else _Kind.BENT
            parts.append(_Part(start, end, kind, wrong=reference + float(np.log(wrong))))
        return parts

    def doubtful(self, room: int) -> list[Interval]:
        """Pieces around parts that need their own scale, within ``room`` values of the function.

        A run of parts without a certain sign is settled if the function has opposite signs at its ends and all its
        polynomials are monotonic: it has one zero. Else it is searched again on twice its width, on its own scale.
        """
        runs = [run for run in self._runs() if any(part.kind in _OPEN for part in run[1])]
        ends = [self._ends(*run) for run in runs]
        unknown = sorted({place for place in itertools.chain(*ends) if place not in self.signs})
        if room < len(unknown) + len(runs):
            self.spent = True
            return []
        if unknown:
            self._ask(np.array(unknown))
        pieces = []
        for (before, run, after), (start, end) in zip(runs, ends, strict=True):
            # Beyond the known parts the function keeps the sign at their end.
            seen = before.sign in (self.signs[start], 0.0) and after.sign in (self.signs[end], 0.0)
            if seen and before.sign * after.sign <= 0.0 and all(part.kind is not _Kind.BENT for part in run):
                continue
            a, b = run[0].a, run[-1].b
            level = max(part.wrong for part in run) - np.log(_CLEAR)
            # The function's own error may reach its polynomial's distance from zero.
            if self._fine(a, b, _FINEST) or (self.error and level <= self.error(np.array([0.5 * a + 0.5 * b]))[0]):
                self.put([_Part(a, b, _Kind.ZERO)])
                continue
            wider = 0.5 * (b - a)
            pieces.append((max(a - wider, self.low), min(b + wider, self.high)))
        return pieces

    def _ends(self, before: _Part, run: list[_Part], after: _Part) -> Interval:
        """Places on both sides of a run, in the parts with a sign beside it if there are any."""
        a, b = run[0].a, run[-1].b
        middle, apart = 0.5 * a + 0.5 * b, _BESIDE * (self.high - self.low)
        left, right = before.a if before.sign else before.b, after.b if after.sign else after.a
        return max(min(a, middle - apart), left), min(max(b, middle + apart), right)

    def _runs(self) -> Iterator[tuple[_Part, list[_Part], _Part]]:
        """Groups of adjacent parts where the function may vanish, with the parts before and after."""
        before, run = _Part(self.low, self.low, _Kind.SKIPPED), []
        for part in [*self.parts, _Part(self.high, self.high, _Kind.SKIPPED)]:
            if part.kind in (*_OPEN, _Kind.ZERO):
                run.append(part)
                continue
            if run:
                yield before, run, part
            before, run = part, []

    def result(self) -> Zeros:
        """The zeros from the current parts."""
        met = sorted((place, sign) for place, sign in self.signs.items() if sign in (-1.0, 1.0))
        changes: list[Interval] = [(x, x) for x in (self.low, self.high) if self.signs.get(x) == 0.0]
        touches: list[Interval] = []
        for before, run, after in self._runs():
            first, last = run[0], run[-1]
            u = before.sign or (first.kind is not _Kind.ZERO) * self.signs.get(first.a, 0.0)
            v = after.sign or (last.kind is not _Kind.ZERO) * self.signs.get(last.b, 0.0)
            if u * v < 0.0:
                left = [place for place, sign in met if place <= first.a and sign == u]
                right = [place for place, sign in met if place >= last.b and sign == v]
                changes += zip(left[-1:], right[:1], strict=False)
            else:
                touches += [part[:2] for part in run if part.kind is _Kind.ZERO]
        rough = _joined([part[:2] for part in self.parts if part.kind is _Kind.ROUGH])
        for a, b in rough:
            # The zeros here are not separated, but the observed changes of sign are certain.
            within = [each for each in met if a <= each[0] <= b]
            changes += [(x, y) for (x, u), (y, v) in itertools.pairwise(within) if u != v]
        # A zero on the border of two pieces leaves no part without a sign.
        changes += [(u.b, u.b) for u, v in itertools.pairwise(self.parts) if u.sign * v.sign < 0.0]
        changes.sort()
        apart = [(a, b) for a, b in _joined(touches) if not any(x <= b and a <= y for x, y in changes)]
        missing = _joined([part[:2] for part in self.parts if part.kind is _Kind.MISSING])
        return Zeros(tuple(changes), tuple(apart), tuple(rough), tuple(missing), self.spent)


def interpolated(values: Array, places: Array) -> tuple[Array, Array, Array]:
    """Chebyshev coefficients of polynomials through values at a set of places above, errors, values at ``DENSE``."""
    fit, at_checks, at_dense, checks = _matrices(places.size)
    coefficients: Array = fit @ np.delete(values, checks, axis=0)
    off = np.abs(at_checks @ coefficients - values[checks]).max(axis=0)
    return coefficients, np.maximum(off, np.abs(coefficients[-2:]).max(axis=0)), at_dense @ coefficients


@cache
def _matrices(count: int) -> tuple[Array, Array, Array, list[int]]:
    """Matrices from values at nodes to coefficients, from these to values at checks and ``DENSE``; the checks."""
    places, first = (FEW_PLACES, 5) if count == FEW_PLACES.size else (MORE_PLACES[:count], DEGREE + 1)
    checks = [first, first + 1]
    nodes = np.delete(places, checks)
    fit, others, dense = (chebyshev.chebvander(each, nodes.size - 1) for each in (nodes, places[checks], DENSE))
    return np.asarray(np.linalg.inv(fit)), np.asarray(others), np.asarray(dense), checks


def _wide(part: _Part, a: float, b: float) -> bool:
    """True if a part without a certain sign is a large part of its piece."""
    return part.kind in _OPEN and 0.5 * part.b - 0.5 * part.a > _NARROW * (0.5 * b - 0.5 * a)


def places_in(a: float, b: float, parts: Array) -> Array:
    """Map -1 ... 1 to a ... b, with exact ends and no overflow."""
    places = (0.5 * a + 0.5 * b) + (0.5 * b - 0.5 * a) * parts
    return np.asarray(np.where(parts <= -1.0, a, np.where(parts >= 1.0, b, np.clip(places, a, b))))


def _levels(coefficients: Array, level: float) -> Array:
    """Places within -1 ... 1 at which a polynomial equals a level or its negative, in order."""
    constant = np.eye(1, coefficients.size)[0]
    both = [chebyshev.chebroots(np.trim_zeros(coefficients + side * constant, "b")) for side in (-level, level)]
    roots = np.concatenate(both)
    return np.sort(roots[(np.abs(roots.imag) < _REAL) & (np.abs(roots.real) < 1.0)].real)


def _joined(pieces: list[Interval]) -> list[Interval]:
    """Pieces in order, with adjacent ones merged."""
    joined: list[Interval] = []
    for a, b in sorted(pieces):
        if joined and a <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(b, joined[-1][1]))
        else:
            joined.append((a, b))
    return joined
