"""Multipliers along a family of matrices: eigenvalues, their errors, and the critical ones.

:class:`Spectra` keeps what is known of a family. At any value it gives the eigenvalues, their margins (distances from
the circle, with a sign), and bounds on the errors of these, from matrices that are changed within their errors. For
each :class:`CircleEvent` it has a function, analytic in the parameter, that vanishes where multipliers are critical: a
product of one factor per multiplier, or per pair of them. Factors that vanish throughout are idle, and left out. At a
:class:`Root` of such a function the critical multipliers give a :class:`Crossing`.
"""

from __future__ import annotations

import bisect
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from chilopod.errors import AnalysisError
from chilopod.flows import deadline
from chilopod.flows.carrying import numerical_balance
from chilopod.flows.deadline import SpentError
from chilopod.frozen import Array, ComplexArray
from chilopod.labels import Labelled
from chilopod.stability.spectrum import DRAWS, EPSILON, SAFETY, disturbed

Matrices = Callable[[Array], tuple[Array, Array]]
"""``matrices(values)``, values of shape (k,), gives real matrices, shape (k, m, m), and bounds on the errors of their
entries: relative, shape (k,), or each, shape (k, m, m). It raises AnalysisError, or gives NaN, for a missing matrix,
and may be called twice for a value."""

_ROUNDING = 2.0 * EPSILON
_SMALLEST = -1e300  # logarithm of zero
_LARGEST = 1e150  # modulus to which larger multipliers are reduced
_TURNING = 1e-6  # least imaginary part of a complex multiplier, relative to its size
_SMALL = 1e-3  # modulus of multipliers that are far inside the circle
_SPARE = 8  # number of factors, beside the idle ones, in the sum over factors to leave out
UNKNOWN = 1.0  # error of a multiplier's margin that reaches from zero to the circle, and so leaves it undetermined
_ULPS = 64.0  # least distance, in units in the last place, of the values whose multipliers give a rate of change
_TELLING = 0.01  # error of a margin, from -1 to 1, that determines the multiplier's side
_FILL = 1e-30  # value in place of zeros, relative to the largest entry, for the balance of a triangular matrix


class CircleEvent(Labelled):
    """A place at which multipliers of a return map meet the unit circle."""

    MINUS = "-1", "a real multiplier passes -1"
    PLUS = "+1", "a real multiplier passes +1"
    PAIR = "pair", "a complex pair passes the unit circle"


TARGETS = {CircleEvent.MINUS: -1.0, CircleEvent.PLUS: 1.0}


def distances(nu: ComplexArray, event: CircleEvent) -> Array:
    """Distances of multipliers from their critical value at an event: from -1, from +1, or from the circle."""
    return np.asarray(np.abs(np.abs(nu) - 1.0) if event is CircleEvent.PAIR else np.abs(nu - TARGETS[event]))


class Root(NamedTuple):
    """A place where a multiplier may be critical, with its enclosing interval."""

    place: float
    left: float
    right: float
    event: CircleEvent | None  # event whose function vanishes; None if a multiplier was followed by its rank
    touch: bool = False  # the function does not change sign
    known: tuple[float, float] = (0.0, 0.0)  # interval without another root of the event, if known


@dataclass(frozen=True)
class Crossing:
    """Multipliers on the unit circle at a value of the parameter."""

    value: float
    bracket: tuple[float, float]  # interval of the root finder around the value, without errors of the matrices
    event: CircleEvent
    multiplicity: int  # number of multipliers on the circle, counting both of a pair
    change: int  # rise of the number outside; 0 for a touch; at an end of the interval for a continued motion
    multiplier: complex  # critical multiplier, the one with positive imaginary part of a pair
    collision: bool = False  # True if they meet on the circle: a conservative family
    around: tuple[float, float] = (0.0, 0.0)  # evaluated values on both sides without another root, if known


class Spectra:
    """Eigenvalues of a family of matrices M, each computed once.

    Errors come from random changes of M within its errors (:mod:`chilopod.stability.spectrum`). The
    relative error of an entry multiplies the geometric mean of the largest entries of its row and column, in units that
    balance M: this does not depend on the units, and keeps a small multiplier beside a huge one if the matrix separates
    them. M is evaluated at up to ``budget`` values, twice where errors matter, or ``affordable()`` more.
    """

    def __init__(self, matrices: Matrices, budget: int, affordable: Callable[[], int] | None = None) -> None:
        self.values: list[float] = []  # values with a matrix, in order
        self.known: dict[float, ComplexArray | None] = {}  # eigenvalues; None for a missing matrix
        self.size = 0  # number of eigenvalues, once a matrix is known
        self.idle = dict.fromkeys(CircleEvent, 0)  # numbers of factors of an event's function that vanish throughout
        self.conservative = False  # multipliers come in pairs with product 1 throughout, and may stay on the circle
        self._matrices = matrices
        self._budget = budget
        self._affordable = affordable
        self._stretch: dict[float, float] = {}
        self._disturbed: dict[float, ComplexArray] = {}
        self._units: Array | None = None

    @property
    def resting(self) -> int:
        """Number of multipliers that are +1 or -1 throughout."""
        return self.idle[CircleEvent.PLUS] + self.idle[CircleEvent.MINUS]

    @property
    def left(self) -> int:
        """Remaining number of values."""
        left = self._budget - len(self.known)
        return left if self._affordable is None else min(left, self._affordable())

    def at(self, values: Array) -> ComplexArray:
        """Eigenvalues by falling modulus, shape (k, m); NaN for a missing matrix."""
        wanted = values.tolist()
        missing = sorted({value for value in wanted if value not in self.known})
        if missing:
            self._compute(missing)
        none = np.full(self.size, np.nan + 0j)
        each = [self.known[value] for value in wanted]
        return np.array([none if nu is None else nu for nu in each]).reshape(len(wanted), self.size)

    def _compute(self, values: list[float]) -> None:
        self.known.update(dict.fromkeys(values))
        found = self._ask(values)
        if not found:
            return
        balanced = self._balanced(np.array([matrix for _, matrix, _ in found]))
        self.size = balanced.shape[-1]
        for (value, _, _), nu, stretch in zip(found, _eigenvalues(balanced), _stretches(balanced), strict=True):
            self.known[value] = nu
            self._stretch[value] = float(stretch)
            bisect.insort(self.values, value)

    def _ask(self, values: list[float]) -> list[tuple[float, Array, Array]]:
        """The values with a matrix, with the matrix and its error."""
        try:
            matrices, errors = self._matrices(np.array(values))
        except (AnalysisError, SpentError):
            middle = (len(values) + 1) // 2
            return self._ask(values[:middle]) + self._ask(values[middle:]) if len(values) > 1 else []
        return [each for each in zip(values, matrices, errors, strict=True) if np.isfinite(each[1]).all()]

    def _balanced(self, matrices: Array) -> Array:
        """Matrices in common units of the states that give rows and columns similar sizes."""
        if self._units is None:
            size = np.abs(matrices).max(axis=0)
            units = numerical_balance(size + _FILL * size.max())
            self._units = units if (np.isfinite(units) & (units > 0.0)).all() else np.ones_like(units)
        return np.asarray(matrices * (self._units / self._units[:, None]))

    def exists(self, value: float) -> bool:
        """True if a matrix exists at a value, which is evaluated if unknown."""
        self.at(np.array([value]))
        return self.known[value] is not None

    def beside(self, place: float, apart: float = 0.0) -> tuple[float, float]:
        """The nearest values with a matrix beside a place, at a least distance; else the place, or one beyond it."""
        here = bisect.bisect_left(self.values, place)
        left = next((v for v in reversed(self.values[:here]) if place - v >= apart), min(self.values[0], place))
        after = self.values[bisect.bisect_right(self.values, place) :]
        return left, next((v for v in after if v - place >= apart), max(self.values[-1], place))

    def holes(self, low: float, high: float) -> bool:
        """True if a matrix is missing between two values."""
        return any(low < value < high and nu is None for value, nu in self.known.items())

    def without_pair(self, low: float, high: float) -> bool:
        """True if all complex multipliers are clear of the circle between two values, judged by known values: the
        bialternate product also vanishes where two real multipliers have product 1."""
        values = self.values[bisect.bisect_left(self.values, low) : bisect.bisect_right(self.values, high)]
        if self.conservative or len(values) < 2:
            return False
        nu = self.at(np.array(values))
        # Rounding decides if small ones are real or a pair; a pair that grew from them would change the count.
        turning = (nu.imag > _TURNING * np.abs(nu)) & (np.abs(nu) > _SMALL)
        if (turning.sum(axis=1) != turning[0].sum()).any():
            return False
        found = margins(nu[turning].reshape(len(values), -1))
        least, most = found.min(axis=0), found.max(axis=0)
        return bool(((2.0 * least - most > 0.0) | (2.0 * most - least < 0.0)).all())

    def disturbed(self, values: Array) -> ComplexArray:
        """Eigenvalues of matrices changed within their errors, shape (k, draws, m); NaN for a missing matrix."""
        missing = sorted({value for value in values.tolist() if value not in self._disturbed})
        if missing:
            self.at(np.array(missing))
            found = self._ask(missing)
            # Without their errors multipliers would seem uncertain.
            deadline.check(0.0 if len(found) < len(missing) else deadline.MORE)
            for value, matrix, error in found:
                deadline.check(deadline.MORE)
                copies = disturbed(*self._with_error(matrix, error))
                if np.isfinite(copies).all():
                    self._disturbed[value] = _eigenvalues(copies)
            for value in missing:
                self._disturbed.setdefault(value, np.full((DRAWS, self.size), np.nan + 0j))
        return np.array([self._disturbed[value] for value in values.tolist()])

    def _with_error(self, matrix: Array, error: Array) -> tuple[Array, Array]:
        """A matrix in units that balance it, and the errors of its entries."""
        balanced = self._balanced(matrix)
        size = np.abs(balanced)
        spread = np.sqrt(size.max(axis=1))[:, None] * np.sqrt(size.max(axis=0))
        error = np.nan_to_num(np.abs(error), nan=0.0, posinf=1.0)
        one = error.ndim == 0  # for all entries
        return balanced, (_ROUNDING + error) * spread if one else _ROUNDING * spread + self._balanced(error)

    def margins(self, value: float) -> Array:
        """Margin of each multiplier (see :func:`margins`), falling, shape (m,)."""
        return margins(self.at(np.array([value])))[0]

    def margin_errors(self, value: float) -> Array:
        """Bounds on the errors of :meth:`margins`."""
        moved = margins(self.disturbed(np.array([value]))[0]) - self.margins(value)
        return np.asarray(SAFETY * np.abs(moved).max(axis=0) + _ROUNDING)

    def factor_sizes(self, value: float, event: CircleEvent) -> tuple[Array, Array]:
        """Rising sizes of the factors of an event's function, and their errors."""
        sizes = np.sort(np.abs(factors(self.at(np.array([value])), event)), axis=-1)
        moved = np.sort(np.abs(factors(self.disturbed(np.array([value])), event)), axis=-1)[0]
        return sizes[0], np.asarray(SAFETY * np.abs(moved - sizes).max(axis=0) + _ROUNDING)

    def function(self, values: Array, event: CircleEvent) -> tuple[Array, Array]:
        """The function that changes sign at an event, as signs and logarithms, shapes (k,).

        det(M + 1), det(M - 1), or the bialternate product, the product of nu_i nu_j - 1 over all pairs (Kuznetsov,
        Elements of Applied Bifurcation Theory, section 10.2.2), over a power of det(1 + M^T M) that keeps them bounded
        however much M stretches. Where some factors vanish throughout, it is the elementary symmetric polynomial of the
        others: of a symplectic matrix, up to its sign, the discriminant of the polynomial in nu + 1/nu (Howard &
        MacKay, J. Math. Phys. 28, 1987).
        """
        signs, logs = symmetric(factors(self.at(values), event), self.idle[event])
        return signs, logs - self._bounds(values, event)

    def _bounds(self, values: Array, event: CircleEvent) -> Array:
        """Logarithms of the divisors of an event's function; NaN for a missing matrix."""
        stretch = np.array([self._stretch.get(value, np.nan) for value in values.tolist()])
        return np.asarray(stretch * (1.0 if event is not CircleEvent.PAIR else self.size - 1.0))

    def function_error(self, values: Array, event: CircleEvent) -> Array:
        """Logarithm of the error of :meth:`function`, shape (k,)."""
        both = np.concatenate([self.at(values)[:, None], self.disturbed(values)], axis=1)
        of_all = symmetric(factors(both.reshape(-1, self.size), event), self.idle[event])
        signs, logs = (part.reshape(both.shape[:2]) for part in of_all)
        top = np.maximum(np.maximum(logs[:, :1], logs[:, 1:]), _SMALLEST)
        with np.errstate(divide="ignore"):
            moved = signs[:, :1] * np.exp(logs[:, :1] - top) - signs[:, 1:] * np.exp(logs[:, 1:] - top)
            largest = np.fmax.reduce(np.log(np.abs(moved)) + top, axis=1, initial=-np.inf)
        return np.asarray(largest - self._bounds(values, event) + np.log(SAFETY))

    def rooted(
        self, function: Callable[[float], float], a: float, b: float, event: CircleEvent | None, within: float
    ) -> Root:
        """The root of a function of the eigenvalues between opposite signs, within a distance or to the last digits."""
        most = min(200, max(self.left, 1))
        place = brentq(function, a, b, xtol=max(within, 5e-324), rtol=4 * EPSILON, maxiter=most, disp=False)
        reach = within + 4.0 * EPSILON * abs(place)
        return Root(place, max(place - reach, a), min(place + reach, b), event, known=(a, b))

    def tolerances(self, root: Root) -> Array:
        """Largest margins of multipliers that may be on the circle at a root, shape (m,)."""
        apart = max(_ULPS * float(np.spacing(abs(root.place))), 0.5 * (root.right - root.left))
        left, right = self.beside(root.place, apart)
        errors = self.margin_errors(root.place)
        if left != right:
            changes = np.abs(self.margins(right) - self.margins(left))
            reach = max(4.0 * float(np.spacing(abs(root.place))), root.right - root.left)
            errors = errors + changes * min(reach / (right - left), 1.0)
        if errors.max() <= _TELLING:
            return np.asarray(errors)
        # Where the orbit is uncertain, multipliers lie between those of the nearest certain places, or between one such
        # place and an end of the interval.
        here = bisect.bisect_left(self.values, root.place)
        sides = [
            next((v for v in near if self.margin_errors(v).max() <= _TELLING), None)
            for near in (self.values[:here][::-1], self.values[here:])
        ]
        telling = [side for side in sides if side is not None]
        if not telling:
            return np.asarray(errors)
        first, last = (self.margins(root.place if side is None else side) for side in sides)
        certain = np.max([self.margin_errors(side) for side in telling], axis=0)
        return np.minimum(errors, certain + np.abs(last - first))

    def critical_at(self, root: Root) -> list[Crossing]:
        """Crossings at a root, by place on the circle, without multipliers that rest there; changes are unknown yet."""
        nu = self.at(np.array([root.place]))[0]
        allowed = self.tolerances(root)
        critical = np.abs(self.margins(root.place)) <= allowed
        if root.event is None:
            # No function vanishes here: an undetermined multiplier does not count as critical.
            critical &= allowed <= UNKNOWN
        rest, found = nu[critical], []
        conservative, bracket, around = self.conservative, (root.left, root.right), root.known
        for event, target in TARGETS.items():
            if not rest.size:
                break
            reach = self.factor_sizes(root.place, event)[1][: rest.size].max() + allowed.max()
            # A real multiplier on the circle is +1 or -1: for any errors a critical one is so at the nearer one.
            near = ((np.abs(rest - target) <= reach) | (rest.imag == 0.0)) & (rest.real * target > 0.0)
            number = int(near.sum()) - self.idle[event]
            if number > 0 and (not conservative or root.event in (event, None)):
                best = complex(rest[near][np.abs(rest[near] - target).argmin()])
                meeting = conservative and number % 2 == 0
                found.append(Crossing(root.place, bracket, event, number, 0, best, meeting, around))
            rest = rest[~near]
        upper = rest[rest.imag > 0.0]
        if conservative:
            two_meet = root.event is CircleEvent.PAIR and not root.touch and upper.size >= 2
            upper = _meeting(upper) if two_meet else upper[:0]
        if upper.size:
            best = complex(upper[np.abs(np.abs(upper) - 1.0).argmin()])
            found.append(Crossing(root.place, bracket, CircleEvent.PAIR, 2 * upper.size, 0, best, conservative, around))
        return found


def margins(nu: ComplexArray) -> Array:
    """tanh(ln |nu|), falling along the last axis: the distance from the circle near it, -1 for 0, 1 for infinity."""
    with np.errstate(divide="ignore"):
        return np.asarray(-np.sort(-np.tanh(np.log(np.abs(nu))), axis=-1))


def factors(nu: ComplexArray, event: CircleEvent) -> ComplexArray:
    """Factors that vanish at an event: nu + 1, nu - 1, or nu_i nu_j - 1 over all pairs, along the last axis."""
    if event is not CircleEvent.PAIR:
        return nu - TARGETS[event]
    first, second = _pairs(nu.shape[-1])
    nu = nu * (_LARGEST / np.maximum(np.abs(nu), _LARGEST))  # so that no product overflows
    return np.asarray(nu[..., first] * nu[..., second] - 1.0)


@np.errstate(divide="ignore", invalid="ignore")
def symmetric(terms: ComplexArray, left_out: int) -> tuple[Array, Array]:
    """Elementary symmetric polynomials of the rows of ``terms``, all but ``left_out`` of them at a time, as signs and
    logarithms, shapes (k,). The rows are closed under conjugation; those of a missing matrix are NaN, as the results.
    """
    small = np.zeros((terms.shape[0], left_out + 1), dtype=np.complex128)
    small[:, 0] = 1.0
    logs = np.zeros(terms.shape[0])
    if left_out:
        terms = np.take_along_axis(terms, np.argsort(np.abs(terms), axis=1), axis=1)
        few = 2 * left_out + _SPARE
        for term in terms[:, :few].T:
            # Times (term + t), up to t^left_out; the others are too far from zero to matter.
            scale = np.maximum(np.abs(term), 1.0)
            logs += np.log(scale)
            shifted = np.concatenate([np.zeros_like(small[:, :1]), small[:, :-1]], axis=1)
            small = small * (term / scale)[:, None] + shifted / scale[:, None]
        terms = terms[:, few:]
    sizes, last = np.abs(terms), small[:, left_out]
    logs = logs + np.log(sizes).sum(axis=1) + np.log(np.abs(last.real))
    # Real and imaginary part separately: the quotient of a complex subnormal and its size would overflow.
    divisors = np.where(sizes == 0.0, 1.0, sizes)
    directions = terms.real / divisors + 1j * (terms.imag / divisors)
    return np.asarray(np.sign((np.prod(directions, axis=1) * last).real)), np.asarray(logs)


@cache
def _pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return np.triu_indices(count, 1)


def _meeting(upper: ComplexArray) -> ComplexArray:
    """The two nearest to each other."""
    first, second = _pairs(upper.size)
    nearest = int(np.abs(upper[first] - upper[second]).argmin())
    return upper[[first[nearest], second[nearest]]]


def _stretches(balanced: Array) -> Array:
    """Logarithms of det(1 + M^T M)^(1/2), M balanced: a positive, analytic divisor that exceeds its dividend."""
    one = np.broadcast_to(np.eye(balanced.shape[-1]), balanced.shape)
    return np.asarray(0.5 * np.linalg.slogdet(np.block([[one, -np.swapaxes(balanced, 1, 2)], [balanced, one]]))[1])


def _eigenvalues(balanced: Array) -> ComplexArray:
    """Eigenvalues by falling modulus, shape (k, m).

    The states with the largest rows come first: for a matrix graded downward the QR algorithm resolves small
    eigenvalues relative to their size (Stewart, Numer. Math. 90, 2001), for others they are rounding.
    """
    order = np.argsort(-np.abs(balanced).max(axis=-1), axis=-1)
    each = np.arange(len(balanced))[:, None]
    graded = balanced[each[..., None], order[:, :, None], order[:, None, :]]
    nu = np.linalg.eigvals(graded).astype(np.complex128)
    return np.asarray(nu[each, np.argsort(-np.abs(nu), axis=-1)])
