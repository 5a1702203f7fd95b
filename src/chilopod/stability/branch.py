"""Branches of periodic orbits: pseudo-arclength continuation in one parameter, with what happens along the way.

A branch is a curve of pairs (orbit, parameter) with H(x, p) = x. It is followed by its arclength, so that folds are
ordinary points of it (see :mod:`chilopod.stability.curve`). Between two points the multipliers tell whether stability
changed; where it did, the point is located along the curve. A branch can be followed in pieces: what it ends with is
all that the next step depends on.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError, ChilopodError, ParameterError
from chilopod.stability.curve import BranchPoint, Curve, sorted_multipliers
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.returns import return_map, whole_period
from chilopod.stability.samples import Family

__all__ = ["Branch", "BranchPoint", "Ending", "begin", "follow", "leave_pitchfork", "proceed"]

Array = NDArray[np.float64]

LONGEST = 0.15
"""Largest step along a curve by default, in units of the state and of the branch's scale."""

_SHORTEST = 1e-5  # step at which a curve is lost, relative to the longest
_FEW, _MANY = 4, 7  # corrections after which steps grow, and shrink

Progress = Callable[[int, BranchPoint], None]


def _silent(count: int, point: BranchPoint) -> None:
    """A :data:`Progress` that shows nothing."""


class Ending(enum.Enum):
    """Why a branch ends where it does; each member's ``sentence`` says it in words."""

    LEFT_INTERVAL = "left the interval", "the parameter reached an end of the interval"
    ENOUGH_POINTS = "enough points", "as many points as were asked for"
    LOST = "lost", "the step became too small: the curve could not be followed further"

    def __init__(self, label: str, sentence: str) -> None:
        self.label = label
        self.sentence = sentence


@dataclass(frozen=True)
class Branch:
    """A followed branch.

    Attributes
    ----------
    points
        Along the curve, special points among them.
    ending
        Why it ends.
    scale
        Of the parameter along the curve: tangents have it in this unit.
    step
        Along the curve, with which it goes on.
    """

    points: tuple[BranchPoint, ...]
    ending: Ending
    scale: float
    step: float

    @property
    def special_points(self) -> tuple[BranchPoint, ...]:
        """Folds and secondary bifurcations."""
        return tuple(point for point in self.points if point.special is not None)


def follow(
    family: Family,
    start: BranchPoint,
    between: tuple[float, float],
    *,
    points: int = 100,
    step: float = 0.02,
    longest: float = LONGEST,
    progress: Progress = _silent,
) -> Branch:
    """Follow a branch from a point along its tangent.

    Parameters
    ----------
    family
        ``family(value)`` is the system; the full period is used even where it has a half-period symmetry, for the
        orbits of interest have lost it.
    start
        From :func:`leave_pitchfork` or :func:`begin`.
    between
        Interval of the parameter; the branch ends where it leaves it. Its width becomes the branch's scale.
    points
        At most so many ordinary points.
    step, longest
        First and largest step along the curve, in units of the state and of the scale.
    progress
        Called with the number of points and the newest one.

    Raises
    ------
    ParameterError
        If the interval is no interval, or ``points`` or a step is not positive.
    """
    low, high = _checked(between, points, longest)
    if not step > 0:
        raise ParameterError("must be positive", field="step", value=step)
    return _followed(
        family, Branch((start,), Ending.ENOUGH_POINTS, high - low, step), between, points, longest, progress
    )


def proceed(
    family: Family,
    branch: Branch,
    between: tuple[float, float],
    *,
    points: int = 100,
    longest: float = LONGEST,
    progress: Progress = _silent,
) -> Branch:
    """Follow a branch on from where it ends; in pieces it has the same points as in one.

    Parameters
    ----------
    family, points, longest, progress
        As for :func:`follow`; ``points`` are those that are added.
    branch
        From :func:`follow` or from here.
    between
        Interval of the parameter, which may have become another one; the branch keeps its scale.

    Returns
    -------
    The branch as it was with the new points behind.

    Raises
    ------
    ParameterError
        As :func:`follow`, and if the branch ends outside the interval, where it would leave it at once.
    """
    low, high = _checked(between, points, longest)
    end = branch.points[-1].value
    if not low <= end <= high:
        raise ParameterError(
            "does not hold the branch's last point", field="between", value=between, allowed=f"{end!r} within"
        )
    return _followed(family, branch, between, points, longest, progress)


def leave_pitchfork(family: Family, point: BifurcationPoint, side: int = 1) -> BranchPoint:
    """The start of one of the two branches that meet at a pitchfork.

    Parameters
    ----------
    family
        As it was given to :func:`chilopod.stability.locate`.
    point
        The located pitchfork.
    side
        +1 along the critical mode, -1 against it.
    """
    if point.kind is not Kind.PITCHFORK:
        raise ParameterError("is not a pitchfork", field="point", value=point.kind.label)
    image = return_map(whole_period(family(point.value)), point.orbit, with_error=False)
    tangent = np.append(np.sign(side) * point.mode.real, 0.0)
    return BranchPoint(
        point.value, point.orbit, sorted_multipliers(image), tangent / np.linalg.norm(tangent), Kind.PITCHFORK
    )


def begin(family: Family, value: float, orbit: ArrayLike, rising: bool, width: float) -> BranchPoint:
    """The start of a branch at an orbit that is known, towards a rising or falling parameter.

    Parameters
    ----------
    family
        ``family(value)`` is the system.
    value, orbit
        Parameter and orbit, shape (n,).
    rising
        The direction to start in.
    width
        Width of the interval that the branch will be followed through.
    """
    x = np.asarray(orbit, dtype=np.float64)
    curve = Curve(family, width)
    image = curve.image(x, value)
    slope = np.linalg.solve(np.eye(x.size) - image.jacobian, curve.parameter_derivative(x, value))
    tangent = np.append(slope, 1.0) * (1.0 if rising else -1.0)
    return BranchPoint(value, x, sorted_multipliers(image), tangent / np.linalg.norm(tangent))


def _checked(between: tuple[float, float], points: int, longest: float) -> tuple[float, float]:
    low, high = between
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ParameterError("must rise from a lower to a higher finite value", field="between", value=between)
    for name, value in (("points", points), ("longest", longest)):
        if not value > 0:
            raise ParameterError("must be positive", field=name, value=value)
    return low, high


def _followed(
    family: Family, branch: Branch, between: tuple[float, float], points: int, longest: float, progress: Progress
) -> Branch:
    curve, size, found = Curve(family, branch.scale), branch.step, list(branch.points)
    last, *earlier = [point for point in reversed(found) if point.special in (None, Kind.PITCHFORK)]
    # At a pitchfork itself the curve has two tangents and the matrix is singular, so it is taken a step ahead.
    ahead = size if last.special is Kind.PITCHFORK else 0.0
    anchor = curve.anchor(last, earlier[0] if earlier else None, ahead)
    for count in range(1, points + 1):
        while True:
            try:
                new, corrections = curve.step(anchor, size)
                between_points = curve.special_between(anchor, new.last, size)
                break
            except ChilopodError as error:
                # A parameter may also step out of what the system can have.
                if not isinstance(error, AnalysisError | ParameterError):
                    raise
                size *= 0.5
                if size < _SHORTEST * longest:
                    return Branch(tuple(found), Ending.LOST, curve.scale, size)
        found += [*between_points, new.last]
        anchor = new
        size = min(longest, size * (1.5 if corrections <= _FEW else 1.0 if corrections <= _MANY else 0.6))
        progress(count, new.last)
        if not between[0] <= new.last.value <= between[1]:
            return Branch(tuple(found), Ending.LEFT_INTERVAL, curve.scale, size)
    return Branch(tuple(found), Ending.ENOUGH_POINTS, curve.scale, size)
