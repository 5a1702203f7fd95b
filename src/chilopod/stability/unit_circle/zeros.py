"""All zeros of an analytic function in an interval.

The interval is cut until the function is a polynomial of degree eight on every piece, to a small part of its size
there (the idea of Chebfun: Battles & Trefethen, SIAM J. Sci. Comput. 25, 2004), or to its own error. The zeros of the
polynomials then say where those of the function are; where two of them lie close together, or have just left the real
axis, the piece around them is looked at on its own scale. What is reported rests on signs of the function itself, at
points that separate the zeros; a zero on the border of two pieces lies between the last such point of one and the first
of the other.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

Array = NDArray[np.float64]
Interval = tuple[float, float]
SignedLog = Callable[[Array], tuple[Array, Array]]
"""A function given as ``numpy.linalg.slogdet`` gives a determinant: signs, shape (k,), and logarithms of sizes, shape
(k,), so that no size is too small or too large; NaN where the function cannot be evaluated."""

BUDGET = 20_000
"""Values of the function that a search may ask for, if not told otherwise."""

_DEGREE = 8
_NODES = np.cos(np.pi * np.arange(_DEGREE, -1, -1) / _DEGREE)
_TRANSFORM: Array = np.linalg.inv(chebyshev.chebvander(_NODES, _DEGREE)).astype(np.float64)
_CHECKS = np.array([-0.618, 0.137])  # the function is held against the polynomial here too
_POINTS = np.concatenate([_NODES, _CHECKS])
_DENSE = np.linspace(-1.0, 1.0, 65)
_RESOLVED = 1e-4  # of the largest value on the piece
_CLEAR = 4.0  # times what it may be wrong by: so far from zero a piece has none
_NEAR = 0.02  # a pair of zeros this close to each other, or to the real axis, relative to the piece, is looked at again
_FINEST = 1e-12  # width of a piece about a pair of zeros, relative to the interval
_ROUGH = 2.0**-34  # width at which a piece that is no polynomial is given up, relative to the interval
_HOLE = 2.0**-8  # width of a piece in which the function exists in part, relative to the interval
_ULPS = 256.0  # width of the finest piece in units in the last place
_DEEP = 2.0**-4  # of the interval: on pieces no wider than this the error of the function is asked for
_APART = 4.0  # times how far two zeros are apart: half the width of the piece made around them
_EPSILON = float(np.finfo(float).eps)
_REAL = 1e-10  # imaginary part of a zero that is real


@dataclass(frozen=True)
class Zeros:
    """What a search found; all intervals in order.

    Attributes
    ----------
    changes
        Intervals at whose ends the function has opposite signs, one zero each; a zero met at an end of the interval
        is a pair (a, a).
    touches
        Intervals with a zero of even order, or without any sign that is certain, between equal signs.
    unresolved
        Pieces on which the function is no polynomial: it is not smooth there, or the budget was spent.
    missing
        Pieces on which the function cannot be evaluated, or only in part.
    spent
        True if the budget ended the search.
    """

    changes: tuple[Interval, ...]
    touches: tuple[Interval, ...]
    unresolved: tuple[Interval, ...]
    missing: tuple[Interval, ...]
    spent: bool


def between(low: float, high: float) -> str:
    """Words for an interval of the parameter, with as many digits as tell its ends apart."""
    texts = f"{low:.9g}", f"{high:.9g}"
    return "between {} and {}".format(*(texts if texts[0] != texts[1] else (repr(float(low)), repr(float(high)))))


def first_places(low: float, high: float) -> Array:
    """Where a search begins: the values of the function it asks for first, whatever the function is."""
    return _places(low, high, _POINTS)


def find_zeros(
    function: SignedLog,
    low: float,
    high: float,
    *,
    error: Callable[[Array], Array] | None = None,
    left: Callable[[], int] | None = None,
    skip: Callable[[float, float], bool] | None = None,
) -> Zeros:
    """Find all zeros of an analytic function in an interval.

    Parameters
    ----------
    function
        Takes values, shape (k,); it need not be scaled.
    low, high
        The interval.
    error
        Logarithm of the error of the function at some values, shape (k,): below it a value is zero within its error,
        and the search stops. Asked for where the search goes deep only.
    left
        Number of values of the function that may still be asked for; when there are none the widest pieces have been
        looked at, and the changes of sign met so far are reported. If not given, a budget of ``BUDGET``.
    skip
        True if zeros between two values are of no interest, the function having been evaluated there; asked for narrow
        pieces.
    """
    search = _Search(function, error, skip, low, high)
    room_left = left if left is not None else lambda: BUDGET - search.asked
    pieces = [(low, high)]
    spent = False
    while pieces:
        room = max(room_left(), 0) // (2 * _POINTS.size)
        pieces.sort(key=lambda piece: 0.5 * piece[0] - 0.5 * piece[1])  # the widest first
        if room < len(pieces):
            spent = True
            if room == 0:
                search.unresolved += pieces
                break
        pieces = pieces[room:] + search.look(pieces[:room])
    return search.result(spent)


@dataclass
class _Piece:
    """A piece on which the function is a polynomial, and the points that should separate its zeros."""

    a: float
    b: float
    expected: int
    borders: tuple[bool, bool]
    separators: Array


@dataclass
class _Search:
    function: SignedLog
    error: Callable[[Array], Array] | None
    skip: Callable[[float, float], bool] | None
    low: float
    high: float
    asked: int = 0
    points: dict[float, float] = field(default_factory=dict)  # places that separate zeros, with the sign there
    sampled: dict[float, float] = field(default_factory=dict)  # signs wherever the function was evaluated
    roots: list[tuple[float, float]] = field(default_factory=list)  # of polynomials, with what they may be wrong by
    flat: list[Interval] = field(default_factory=list)  # zero within the error
    unresolved: list[Interval] = field(default_factory=list)
    missing: list[Interval] = field(default_factory=list)

    def look(self, pieces: list[Interval]) -> list[Interval]:
        """Look at some pieces at once; those that are left to be looked at."""
        places = np.array([_places(a, b, _POINTS) for a, b in pieces])
        signs, logs = (part.reshape(places.shape) for part in self._ask(places.ravel()))
        left: list[Interval] = []
        resolved: list[_Piece] = []
        for (a, b), row_signs, row_logs in zip(pieces, signs, logs, strict=True):
            outcome = self._piece(a, b, row_signs, row_logs)
            if isinstance(outcome, _Piece):
                resolved.append(outcome)
            else:
                left += outcome
        return left + self._separate(resolved)

    def _ask(self, places: Array) -> tuple[Array, Array]:
        signs, logs = self.function(places)
        self.asked += places.size
        self.sampled.update(zip(places.tolist(), signs.tolist(), strict=True))
        return signs, logs

    def _fine(self, a: float, b: float, part: float) -> bool:
        """Whether a piece is too narrow to be cut."""
        least = max(part * (0.5 * self.high - 0.5 * self.low), 0.5 * _ULPS * float(np.spacing(max(abs(a), abs(b)))))
        return 0.5 * b - 0.5 * a <= least

    def _piece(self, a: float, b: float, signs: Array, logs: Array) -> _Piece | list[Interval]:
        absent = np.isnan(signs) | np.isnan(logs)
        if absent.any():
            if absent.all() or self._fine(a, b, _HOLE):
                self.missing.append((a, b))
                return []
            return _halves(a, b)
        reference = float(logs.max())
        if reference == -np.inf:
            self.flat.append((a, b))
            return []
        values = signs * np.exp(logs - reference)
        coefficients = _TRANSFORM @ values[: _NODES.size]
        off = np.abs(chebyshev.chebval(_CHECKS, coefficients) - values[_NODES.size :]).max()
        uncertain = float(max(off, np.abs(coefficients[-2:]).max()))
        real, close, spread = _roots(coefficients)
        dense = np.abs(chebyshev.chebval(_DENSE, coefficients))
        unclear = _DENSE[dense <= _CLEAR * uncertain]
        if not unclear.size and not real.size and not close.size:
            return _Piece(a, b, 0, (False, False), np.empty(0))
        # Where the polynomial says nothing there must be one of its zeros at hand, or the end of the piece.
        known = np.concatenate([real, close, [-1.0, 1.0]])
        vague = bool((np.abs(unclear[:, None] - known).min(axis=1) > _NEAR).any()) if unclear.size else False
        single = real[(np.abs(real[:, None] - close) > _NEAR).all(axis=1)]
        slopes = np.abs(chebyshev.chebval(single, chebyshev.chebder(coefficients)))
        vague |= bool((_CLEAR * uncertain > _NEAR * slopes).any())
        if self.skip is not None and self._fine(a, b, _DEEP) and self.skip(a, b):
            return []
        noise = 0.0
        if self.error is not None and (close.size or vague or uncertain > _RESOLVED) and self._fine(a, b, _DEEP):
            noise = _CLEAR * float(np.exp(min(self.error(_places(a, b, _POINTS)).max() - reference, 0.0)))
        if noise >= 1.0:
            self.flat.append((a, b))
            return []
        if uncertain > noise and (uncertain > _RESOLVED or vague):
            if self._fine(a, b, _ROUGH):
                (self.flat if self._fine(a, b, _FINEST) else self.unresolved).append((a, b))
                return []
            return _halves(a, b)
        if close.size:
            around = self._pair(a, b, close, spread, coefficients, uncertain, reference)
            if around is not None:
                return around
            real = self._touches(a, b, real, close, coefficients, max(noise, uncertain))
        slopes = np.abs(chebyshev.chebval(real, chebyshev.chebder(coefficients)))
        reach = _CLEAR * max(uncertain, noise) / np.maximum(slopes, 1e-300)
        self.roots += zip(_places(a, b, real).tolist(), (reach * (0.5 * b - 0.5 * a)).tolist(), strict=True)
        # A zero that may lie on either side of a border is left to whoever compares the signs on both sides.
        doubt = _CLEAR * max(uncertain, noise)
        at_left, at_right = bool(abs(values[0]) <= doubt), bool(abs(values[_DEGREE]) <= doubt)
        kept = real[~(at_left & (real + 1.0 <= reach)) & ~(at_right & (1.0 - real <= reach))]
        alone = (at_left or at_right) and not kept.size
        stations = np.concatenate([[-1.0] if at_left or alone else [], kept, [1.0] if at_right or alone else []])
        return _Piece(a, b, kept.size, (at_left, at_right), _places(a, b, 0.5 * (stations[1:] + stations[:-1])))

    def _pair(
        self,
        a: float,
        b: float,
        close: Array,
        spread: Array,
        coefficients: Array,
        uncertain: float,
        reference: float,
    ) -> list[Interval] | None:
        """Pieces around the first pair of zeros that the error leaves apart; None if there is none."""
        # The error may fall with the function: it is the one in the middle of a pair that counts.
        sure = np.zeros(close.size)
        if self.error is not None:
            sure = _CLEAR * np.exp(np.minimum(self.error(_places(a, b, close)) - reference, 0.0))
        touching = np.abs(chebyshev.chebval(close, coefficients)) + uncertain < sure
        if touching.all() or self._fine(a, b, _FINEST):
            return None
        curvature = abs(float(chebyshev.chebval(close[~touching][0], chebyshev.chebder(coefficients, 2))))
        # Wide enough that the pieces beside it are clear of zeros, and the pair in it for certain.
        unsure = np.sqrt(_CLEAR * max(uncertain, _EPSILON) / max(curvature, _EPSILON))
        reach = min(max(_APART * float(spread[~touching][0]), _APART * unsure), _APART * _NEAR)
        return _around(a, b, float(close[~touching][0]), reach)

    def _touches(self, a: float, b: float, real: Array, close: Array, coefficients: Array, noise: float) -> Array:
        """Note where pairs of zeros cannot be told apart; the zeros that are left."""
        curvature = np.abs(chebyshev.chebval(close, chebyshev.chebder(coefficients, 2)))
        reach = np.minimum(2.0 * np.sqrt(2.0 * noise / np.maximum(curvature, 1e-300)) + _REAL, _NEAR)
        for center, width in zip(close.tolist(), reach.tolist(), strict=True):
            members = real[np.abs(real - center) <= _NEAR]
            ends = np.clip([min([center, *members]) - width, max([center, *members]) + width], -1.0, 1.0)
            start, end = _places(a, b, ends).tolist()
            self.flat.append((start, end))
            real = real[np.abs(real - center) > _NEAR]
        return real

    def _separate(self, pieces: list[_Piece]) -> list[Interval]:
        """Take the signs that separate the zeros of some pieces; the pieces whose zeros do not show in them."""
        wanted = np.concatenate([piece.separators for piece in pieces]) if pieces else np.empty(0)
        signs = self._ask(wanted)[0] if wanted.size else wanted
        left: list[Interval] = []
        for piece in pieces:
            own, signs = signs[: piece.separators.size], signs[piece.separators.size :]
            inner = list(zip(piece.separators.tolist(), own.tolist(), strict=True))
            ends = [(place, self.sampled[place]) for place in (piece.a, piece.b)]
            sequence = ends[:1] * (not piece.borders[0]) + inner + ends[1:] * (not piece.borders[1])
            changes = sum(u * v < 0.0 for (_, u), (_, v) in itertools.pairwise(sequence))
            touched = any(piece.a <= start and end <= piece.b for start, end in self.flat)
            if changes != piece.expected and not touched:
                if self._fine(piece.a, piece.b, _FINEST):
                    self.flat.append((piece.a, piece.b))  # a pair of zeros that rounding hides
                else:
                    left += _halves(piece.a, piece.b)
                continue
            self.points.update((place, sign) for place, sign in ends + inner if sign in (-1.0, 1.0))
        return left

    def result(self, spent: bool) -> Zeros:
        for a, b in self.unresolved:
            # Nothing separates the zeros here; the changes of sign that were met are certain nevertheless.
            self.points.update((x, s) for x, s in self.sampled.items() if a <= x <= b and s in (-1.0, 1.0))
        flat = _joined(self.flat)
        missing = _joined(self.missing)
        changes, touched = [], set()
        for (p, u), (q, v) in itertools.pairwise(sorted(self.points.items())):
            inside = [piece for piece in flat if p <= piece[0] and piece[1] <= q]
            if u * v < 0.0 and not any(p <= a and b <= q for a, b in missing):
                changes.append((p, q))
                touched.update(inside)
        changes = self._narrowed(changes)
        ends = [(x, x) for x in (self.low, self.high) if self.sampled.get(x) == 0.0]
        touches = [
            piece
            for piece in flat
            if piece not in touched and not any(a <= piece[1] and piece[0] <= b for a, b in changes + ends)
        ]
        return Zeros(
            tuple(sorted(changes + ends)), tuple(touches), tuple(_joined(self.unresolved)), tuple(missing), spent
        )

    def _narrowed(self, changes: list[Interval]) -> list[Interval]:
        """Intervals cut down to what the polynomials may be wrong by, where the function changes sign there."""
        cut = []
        for p, q in changes:
            known = [(reach, root) for root, reach in self.roots if p <= root <= q]
            if known:
                reach, root = min(known)
                reach = max(reach, 1e-13 * abs(root))
                cut.append((max(p, root - reach), min(q, root + reach)))
            else:
                cut.append((p, q))
        if not cut:
            return []
        signs = self._ask(np.array(cut).ravel())[0].reshape(-1, 2)
        return [
            new if u * v < 0.0 and new[0] < new[1] else old
            for old, new, (u, v) in zip(changes, cut, signs.tolist(), strict=True)
        ]


def _places(a: float, b: float, parts: Array) -> Array:
    """From -1 ... 1 to a ... b; the ends exactly, no overflow."""
    places = (0.5 * a + 0.5 * b) + (0.5 * b - 0.5 * a) * parts
    return np.asarray(np.where(parts <= -1.0, a, np.where(parts >= 1.0, b, np.clip(places, a, b))))


def _halves(a: float, b: float) -> list[Interval]:
    middle = 0.5 * a + 0.5 * b
    return [(a, middle), (middle, b)]


def _around(a: float, b: float, center: float, reach: float) -> list[Interval]:
    """A piece cut in three, the middle one narrow about a center; in two where the center is near an end."""
    places = _places(a, b, np.array([center - reach, center + reach])).tolist()
    cuts = [a, *(place for place in places if a < place < b), b]
    return list(itertools.pairwise(cuts))


def _roots(coefficients: Array) -> tuple[Array, Array, Array]:
    """Real roots within the piece; where two roots come close to each other, within it or just outside, and how far
    apart they are."""
    kept = np.trim_zeros(coefficients, "b")
    if kept.size < 2:
        return np.empty(0), np.empty(0), np.empty(0)
    roots = chebyshev.chebroots(kept)
    near = roots[(np.abs(roots.real) <= 1.0 + _NEAR) & (np.abs(roots.imag) < _NEAR)]
    real = np.sort(near.real[np.abs(near.imag) < _REAL])
    upper = near[near.imag > _REAL]
    gaps = np.diff(real)
    close = np.concatenate([upper.real, 0.5 * (real[1:] + real[:-1])[gaps < _NEAR]])
    spread = np.concatenate([upper.imag, gaps[gaps < _NEAR]])
    # A pair beyond an end that is farther from it than its members are from each other belongs to another piece.
    own = np.abs(close) <= 1.0 + spread
    return real[np.abs(real) <= 1.0], np.clip(close[own], -1.0, 1.0), spread[own]


def _joined(pieces: list[Interval]) -> list[Interval]:
    """Pieces in order, those that touch as one."""
    joined: list[Interval] = []
    for a, b in sorted(pieces):
        if joined and a <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(b, joined[-1][1]))
        else:
            joined.append((a, b))
    return joined
