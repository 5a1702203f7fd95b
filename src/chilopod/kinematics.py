"""Kinematics of the chain in the plane: headings, positions and velocities of its modules and feet.

Everything follows from module 1 and the joints, without forces. Arrays hold modules along their last axis but for
components, front to rear, feet by side (left, right) behind that; whatever else is in front is a batch. Directions are
those of the axes that headings are measured from: the floor's, or those of module 1 where its heading is given as 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from chilopod.frozen import Array


def module_headings(heading: ArrayLike, joint_angles: ArrayLike) -> Array:
    """Headings of all modules, rad, shape (..., N), from that of module 1, shape (...), and the joint angles, shape
    (..., N-1); likewise their yaw rates, from that of module 1 and the joint rates."""
    return np.asarray(heading, dtype=np.float64)[..., None] + _summed(np.asarray(joint_angles, dtype=np.float64), -1)


def module_centres(position: ArrayLike, headings: Array, length: float) -> Array:
    """Centres of all modules, m, shape (..., N, 2), from that of module 1, m, shape (..., 2), and their headings, rad,
    shape (..., N); ``length`` is that of a module, m."""
    half = 0.5 * length * directions(headings)[0]
    return np.asarray(position)[..., None, :] - _summed(half[..., :-1, :] + half[..., 1:, :], -2)


def module_velocities(velocity: ArrayLike, headings: Array, rates: Array, length: ArrayLike) -> Array:
    """Velocities of the centres of all modules, m/s, shape (..., N, 2): the derivative of :func:`module_centres`, with
    yaw rates, rad/s, shape (..., N), and a length, m, for all or of shape (..., 1)."""
    swing = (0.5 * np.asarray(length, dtype=np.float64) * rates)[..., None] * directions(headings)[1]
    return np.asarray(velocity)[..., None, :] - _summed(swing[..., :-1, :] + swing[..., 1:, :], -2)


def foot_places(forward_offset: ArrayLike, half_width: ArrayLike, stroke: ArrayLike, yaw: ArrayLike = 0.0) -> Array:
    """Positions of all feet in the frames of their modules: ahead of the centre and left of the axis, m, shape (..., N,
    2, 2).

    Offset and half-width are those of a foot at mid-stroke, m, for all or of shape (..., 1, 1); ``stroke`` is how far
    it is ahead of that, m, and ``yaw`` (rad, left positive) turns its stroke about it, both of shape (..., N, 2).
    """
    stroke, side = np.asarray(stroke, dtype=np.float64), np.multiply(half_width, [1.0, -1.0])
    ahead, left = forward_offset + stroke * np.cos(yaw), side + stroke * np.sin(yaw)
    return np.stack(np.broadcast_arrays(ahead, left), axis=-1)


def foot_velocities(places: Array, rates: Array, speed: float, yaw: ArrayLike = 0.0) -> Array:
    """Velocities of standing feet relative to the centres of their modules, in the frames of these, m/s, shape (..., N,
    2, 2).

    Positions and yaw are those of :func:`foot_places`, rates those of the modules, rad/s, shape (..., N); standing feet
    move back along their strokes at ``speed``, m/s.
    """
    turn = rates[..., None]
    along, across = -speed * np.cos(yaw) - turn * places[..., 1], -speed * np.sin(yaw) + turn * places[..., 0]
    return np.stack([along, across], axis=-1)


def from_modules(centres: Array, headings: Array, inside: Array) -> Array:
    """Positions or velocities of feet, shape (..., N, 2, 2), on the axes that headings are measured from.

    ``inside`` has them relative to the centres of their modules, in the frames of these, same shape, or (points, 2) if
    they are alike in all modules; ``centres`` has the positions or velocities of the centres, shape (..., N, 2);
    headings are in rad, shape (..., N).
    """
    ahead, left = (direction[..., None, :] for direction in directions(headings))
    out: Array = centres[..., None, :] + inside[..., :1] * ahead + inside[..., 1:] * left
    return out


def directions(headings: Array) -> tuple[Array, Array]:
    """Unit vectors ahead and to the left, each of shape (..., 2), for headings (rad) of shape (...)."""
    ahead = np.stack([np.cos(headings), np.sin(headings)], axis=-1)
    return ahead, np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)


def _summed(increments: Array, axis: int) -> Array:
    """Running sums along an axis, starting from zero: one entry more."""
    first = np.zeros_like(np.take(increments, [0], axis=axis))
    return np.concatenate([first, np.cumsum(increments, axis=axis)], axis=axis)
