"""Multipliers that are critical at a root."""

from __future__ import annotations

import bisect
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from chilopod.frozen import Array, ComplexArray
from chilopod.stability.unit_circle.spectra import TARGETS, Event, Spectra

UNKNOWN = 1.0  # error of a multiplier's margin that reaches from zero to the circle, and so leaves it undetermined

LOST = "multipliers near the circle are known no better than their distance from it"

_EPSILON = float(np.finfo(float).eps)
_ULPS = 64.0
_TELLING = 0.01  # error of a margin, from -1 to 1, that determines the multiplier's side


class Root(NamedTuple):
    """A place where a multiplier may be critical, with its enclosing interval."""

    place: float
    left: float
    right: float
    event: Event | None  # event whose function vanishes; None if a multiplier was followed by its rank
    touch: bool = False  # the function does not change sign
    known: tuple[float, float] = (0.0, 0.0)  # interval without another root of the event, if known


def rooted(
    spectra: Spectra, function: Callable[[float], float], a: float, b: float, event: Event | None, within: float = 0.0
) -> Root:
    """The root of a function of the eigenvalues between opposite signs, within a distance or to the last digits."""
    most = min(200, max(spectra.left, 1))
    finest = max(within, 5e-324)
    place = float(brentq(function, a, b, xtol=finest, rtol=4 * _EPSILON, maxiter=most, disp=False))
    reach = within + 4.0 * _EPSILON * abs(place)
    return Root(place, max(place - reach, a), min(place + reach, b), event, known=(a, b))


@dataclass(frozen=True)
class Crossing:
    """Multipliers on the unit circle at a value of the parameter."""

    value: float
    bracket: tuple[float, float]  # interval of the root finder around the value, without errors of the matrices
    event: Event
    multiplicity: int  # number of multipliers on the circle, counting both of a pair
    change: int  # rise of the number outside; 0 for a touch; at an end of the interval for a continued motion
    multiplier: complex  # critical multiplier, the one with positive imaginary part of a pair
    collision: bool = False  # True if they meet on the circle and leave it, or come back: a conservative family
    around: tuple[float, float] = (0.0, 0.0)  # evaluated values on both sides without another root, if known


def tolerances(spectra: Spectra, root: Root) -> Array:
    """Largest margins of multipliers that may be on the circle at a root, shape (m,)."""
    ulps = _ULPS * max(float(np.spacing(abs(root.place))), 0.5 * (root.right - root.left) / _ULPS)
    left, right = spectra.beside(root.place, ulps)
    errors = spectra.margin_errors(root.place)
    if left != right:
        changes = np.abs(spectra.margins(right) - spectra.margins(left))
        reach = max(4.0 * float(np.spacing(abs(root.place))), root.right - root.left)
        errors = errors + changes * min(reach / (right - left), 1.0)
    if errors.max() <= _TELLING:
        return np.asarray(errors)
    # Where the orbit is uncertain, multipliers lie between those of the nearest certain places, or between one such
    # place and an end of the interval.
    here = bisect.bisect_left(spectra.values, root.place)
    sides = [
        next((v for v in near if spectra.margin_errors(v).max() <= _TELLING), None)
        for near in (spectra.values[:here][::-1], spectra.values[here:])
    ]
    telling = [side for side in sides if side is not None]
    if not telling:
        return np.asarray(errors)
    first, last = (spectra.margins(root.place if side is None else side) for side in sides)
    apart = np.max([spectra.margin_errors(side) for side in telling], axis=0)
    return np.minimum(errors, apart + np.abs(last - first))


def critical_at(spectra: Spectra, root: Root) -> list[Crossing]:
    """Crossings at a root, by place on the circle, without multipliers that rest there; changes are unknown yet."""
    nu = spectra.at(np.array([root.place]))[0]
    allowed = tolerances(spectra, root)
    critical = np.abs(spectra.margins(root.place)) <= allowed
    if root.event is None:
        # No function vanishes here: an undetermined multiplier does not count as critical.
        critical &= allowed <= UNKNOWN
    rest, found = nu[critical], []
    conservative, bracket, around = spectra.conservative, (root.left, root.right), root.known
    for event, target in TARGETS.items():
        if not rest.size:
            break
        reach = spectra.factor_sizes(root.place, event)[1][: rest.size].max() + allowed.max()
        # A real multiplier on the circle is +1 or -1. For any errors, a critical one is so at the nearer of the
        # two.
        near = ((np.abs(rest - target) <= reach) | (rest.imag == 0.0)) & (rest.real * target > 0.0)
        number = int(near.sum()) - spectra.idle[event]
        if number > 0 and (not conservative or root.event in (event, None)):
            best = complex(rest[near][np.abs(rest[near] - target).argmin()])
            meeting = conservative and number % 2 == 0
            found.append(Crossing(root.place, bracket, event, number, 0, best, meeting, around))
        rest = rest[~near]
    upper = rest[rest.imag > 0.0]
    if conservative:
        upper = _meeting(upper) if root.event is Event.PAIR and not root.touch else upper[:0]
    if upper.size:
        best = complex(upper[np.abs(np.abs(upper) - 1.0).argmin()])
        found.append(Crossing(root.place, bracket, Event.PAIR, 2 * upper.size, 0, best, conservative, around))
    return found


def _meeting(upper: ComplexArray) -> ComplexArray:
    """The two nearest to each other."""
    if upper.size < 2:
        return upper[:0]
    first, second = np.triu_indices(upper.size, 1)
    nearest = int(np.abs(upper[first] - upper[second]).argmin())
    return upper[[first[nearest], second[nearest]]]
