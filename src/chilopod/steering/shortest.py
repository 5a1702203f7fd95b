"""Shortest path to a position for a smallest turning radius and a free heading at the end.

It is an arc and a straight line, or, to a position within a turning circle, an arc away from it and one back: the words
of L. E. Dubins (Am. J. Math. 79, 1957, 497) that remain for a free heading at the end (J.-D. Boissonnat and X.-N. Bui,
INRIA report 2295, 1994).
"""

from __future__ import annotations

import numpy as np

from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.steering.target import ARRIVAL_RADIUS, FARTHEST

_FULL = 2.0 * np.pi
_DIRECTIONS = 64  # on the rim of the disc, at first
_CLOSER = 8  # then between the two beside the best, as often as:
_ROUNDS = 5
_HAIR = 1e-12


def shortest_path(place: Array, radius: float, arrival: float = ARRIVAL_RADIUS) -> Array:
    """Length of the shortest path to within the arrival radius of a position, m, shape (...); 0 within it, NaN for a
    position that is not finite. ParameterError if one of the radii is negative, not a number, or too large. The place
    is distances ahead and to the left, m, shape (..., 2), the radius that of the tightest circle, m, 0 for a robot that
    turns on the spot, and the arrival the distance that counts as arrived, m."""
    for name, value in (("turning radius", radius), ("arrival radius", arrival)):
        if not 0.0 <= value <= FARTHEST:
            allowed = f"from 0, at most {FARTHEST:g} m"
            raise ParameterError("is out of range", field=name, value=f"{value:g} m", allowed=allowed)
    place = np.asarray(place, dtype=np.float64)
    x, y = place[..., 0].ravel(), np.abs(place[..., 1]).ravel()
    length = np.full(x.shape, np.nan)
    apart = np.hypot(x, y)
    length[apart <= arrival] = 0.0
    # A disc outside both circles is entered at right angles, at the end of the straight line to its centre.
    away = np.hypot(x, y - radius)
    outside = (apart > arrival) & (away > radius + arrival)
    length[outside] = _to_point(x[outside], y[outside], radius) - arrival
    near = (apart > arrival) & (away <= radius + arrival)
    if near.any():
        length[near] = _to_disc(x[near], y[near], radius, arrival)
    return length.reshape(place.shape[:-1])


def _to_disc(x: Array, y: Array, radius: float, arrival: float) -> Array:
    """Length to a disc that is not outside of the circle on its side: arcs that run into it, the straight line to its
    centre where it is outside, and the best point of its rim."""

    def to_rim(directions: Array) -> Array:
        return _to_point(x[:, None] + arrival * np.cos(directions), y[:, None] + arrival * np.sin(directions), radius)

    step = _FULL / _DIRECTIONS
    directions = np.broadcast_to(step * np.arange(_DIRECTIONS), (len(x), _DIRECTIONS))
    length = np.fmin(_arc_into(x, y, radius, arrival), _arc_into(x, -y, radius, arrival))
    for side in (y, -y):
        whole, straight = _straight(x, side, radius)
        length = np.fmin(length, np.where(straight >= arrival, whole - arrival, np.nan))
    for _ in range(_ROUNDS):
        found = to_rim(directions)
        best = found.argmin(1)[:, None]
        length = np.fmin(length, np.take_along_axis(found, best, 1)[:, 0])
        between = np.linspace(-step, step, _CLOSER + 1)
        directions, step = np.take_along_axis(directions, best, 1) + between, 2.0 * step / _CLOSER
    return length


def _arc_into(x: Array, y: Array, radius: float, arrival: float) -> Array:
    """Length of the arc to the left until it meets the disc, NaN where it never does."""
    with np.errstate(invalid="ignore", divide="ignore"):
        away = np.hypot(x, y - radius)
        half = np.arccos((radius**2 + away**2 - arrival**2) / (2.0 * radius * away))
    return radius * np.mod(np.arctan2(x, radius - y) - half, _FULL)


def _to_point(x: Array, y: Array, radius: float) -> Array:
    """Length of the shortest path to points."""
    return np.fmin(_about_left(x, y, radius), _about_left(x, -y, radius))


def _straight(x: Array, y: Array, radius: float) -> tuple[Array, Array]:
    """Length of the path to points that turns left and goes straight, and of its straight line."""
    # Squared length of the tangent to the circle. Rounding on the circle may make it slightly negative.
    squared = x * x + y * (y - 2.0 * radius)
    straight = np.sqrt(np.where(squared > -_HAIR * radius**2, np.maximum(squared, 0.0), np.nan))
    # Half of the angle before it: one quotient in two forms, each without cancellation.
    half = np.where(x >= 0.0, np.arctan2(y, x + straight), np.arctan2(straight - x, y - 2.0 * radius))
    return straight + radius * np.mod(2.0 * half, _FULL), straight


def _about_left(x: Array, y: Array, radius: float) -> Array:
    """Length of the shortest path to points that turns left and goes straight, or turns right and then left."""
    length = _straight(x, y, radius)[0]
    if radius == 0.0:
        return length
    # The circle of the second arc touches the one to the right, and the point lies on it: a triangle of three centres.
    from_right = np.hypot(x, y + radius)
    with np.errstate(invalid="ignore", divide="ignore"):
        beside = np.arccos((from_right**2 + 3.0 * radius**2) / (4.0 * radius * from_right))
    for first in (np.arctan2(x, y + radius) + beside, np.arctan2(x, y + radius) - beside):
        ahead, left = x - 2.0 * radius * np.sin(first), y + radius - 2.0 * radius * np.cos(first)
        second = np.arctan2(left, ahead) - np.arctan2(-np.cos(first), -np.sin(first))
        length = np.fmin(length, radius * (np.mod(first, _FULL) + np.mod(second, _FULL)))
    return length
