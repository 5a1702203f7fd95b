"""Which multipliers are critical at a root."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.stability.unit_circle.spectra import Event, Spectra

Array = NDArray[np.float64]

UNKNOWN = 1.0
"""Error of a multiplier's margin that reaches from zero to the circle, and so tells nothing of where it is."""

LOST = "multipliers near the circle are known no better than their distance from it"

_ULPS = 64.0
_TELLING = 0.01  # error of a margin, which goes from -1 to 1, that tells where the multiplier is


@dataclass(frozen=True)
class Root:
    """A place where a multiplier may be critical.

    ``event`` is that of the function that vanishes there, None where a multiplier was followed by its rank; ``touch``
    is whether the function does not change sign.
    """

    place: float
    left: float
    right: float
    event: Event | None
    touch: bool


@dataclass(frozen=True)
class Group:
    """Multipliers that are critical at the same place of the circle."""

    event: Event
    multiplicity: int
    change: int
    multiplier: complex
    collision: bool


@dataclass(frozen=True)
class Point:
    """A root with the multipliers that are critical there."""

    place: float
    left: float
    right: float
    groups: tuple[Group, ...]


class Critical:
    """What is critical at the roots of a family.

    Parameters
    ----------
    spectra
        Eigenvalues of the family.
    idle
        For each event, how many factors of its function vanish throughout.
    conservative
        True if multipliers may stay on the circle.
    """

    def __init__(self, spectra: Spectra, idle: dict[Event, int], conservative: bool) -> None:
        self._spectra = spectra
        self._idle = idle
        self._conservative = conservative

    def tolerances(self, root: Root) -> Array:
        """How far from zero the margins at a root may be if the multiplier is on the circle there."""
        ulps = _ULPS * max(float(np.spacing(abs(root.place))), 0.5 * (root.right - root.left) / _ULPS)
        values = self._spectra.values
        here = int(np.searchsorted(values, root.place))
        left = next((v for v in reversed(values[:here]) if root.place - v >= ulps), root.place)
        right = next((v for v in values[here:] if v - root.place >= ulps), root.place)
        errors = self._spectra.margin_errors(root.place)
        if left != right:
            changes = np.abs(self._spectra.margins(right) - self._spectra.margins(left))
            reach = max(4.0 * float(np.spacing(abs(root.place))), root.right - root.left)
            errors = errors + changes * min(reach / (right - left), 1.0)
        if errors.max() <= _TELLING:
            return np.asarray(errors)
        # Where the orbit itself is uncertain, multipliers are between those of the nearest places where it is not, or
        # between the one such place and an end of the interval.
        sides = [next(filter(self._telling, near), None) for near in (values[:here][::-1], values[here:])]
        telling = [side for side in sides if side is not None]
        if not telling:
            return np.asarray(errors)
        first, last = (self._spectra.margins(root.place if side is None else side) for side in sides)
        apart = np.max([self._spectra.margin_errors(side) for side in telling], axis=0)
        return np.minimum(errors, apart + np.abs(last - first))

    def _telling(self, place: float) -> bool:
        return float(self._spectra.margin_errors(place).max()) <= _TELLING

    def groups(self, root: Root) -> list[Group]:
        """Multipliers that are critical at a root, without those that are so throughout; changes are not known yet."""
        nu = self._spectra.at(np.array([root.place]))[0]
        margins, tolerances = self._spectra.margins(root.place), self.tolerances(root)
        critical = nu[np.abs(margins) <= tolerances]
        if root.event is None:
            # No function vanishes here: what may be anywhere is not on the circle for that.
            critical = nu[(np.abs(margins) <= tolerances) & (tolerances <= UNKNOWN)]
        groups = []
        rest = critical
        for event, target in ((Event.MINUS, -1.0), (Event.PLUS, 1.0)):
            errors = self._spectra.distances(root.place, event)[1]
            distances = np.abs(rest - target)
            near = (
                (distances <= errors[: max(rest.size, 1)].max() + tolerances.max()) if rest.size else np.empty(0, bool)
            )
            # A real multiplier on the circle is nowhere else.
            near = near | ((rest.imag == 0.0) & (rest.real * target > 0.0))
            # However large errors are, what is critical is so at the nearer of the two.
            near = near & (rest.real * target > 0.0)
            number = int(near.sum()) - self._idle[event]
            if number > 0 and (not self._conservative or root.event in (event, None)):
                best = complex(rest[near][np.abs(rest[near] - target).argmin()])
                groups.append(Group(event, number, 0, best, self._conservative and number % 2 == 0))
            rest = rest[~near]
        upper = rest[rest.imag > 0.0]
        if self._conservative:
            upper = self._meeting(upper) if root.event is Event.PAIR and not root.touch else upper[:0]
        if upper.size:
            best = complex(upper[np.abs(np.abs(upper) - 1.0).argmin()])
            groups.append(Group(Event.PAIR, 2 * upper.size, 0, best, self._conservative))
        return groups

    @staticmethod
    def _meeting(upper: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """The two nearest to each other."""
        if upper.size < 2:
            return upper[:0]
        first, second = np.triu_indices(upper.size, 1)
        nearest = int(np.abs(upper[first] - upper[second]).argmin())
        return upper[[first[nearest], second[nearest]]]

    def outside_near(self, group: Group, place: float) -> int:
        """How many of the multipliers nearest to those of a group are outside the circle at a place beside it."""
        nu = self._spectra.at(np.array([place]))[0]
        if group.event is Event.PAIR:
            nu = nu[nu.imag > 0.0]
            nearest = np.argsort(np.abs(nu - group.multiplier))[: group.multiplicity // 2]
            return 2 * int((np.abs(nu[nearest]) > 1.0).sum())
        nearest = np.argsort(np.abs(nu - group.multiplier))[: group.multiplicity]
        return int((np.abs(nu[nearest]) > 1.0).sum())
