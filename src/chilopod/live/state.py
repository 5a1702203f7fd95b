"""States of a live walk that can be seen, its settings, and their limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.engine import Status
from chilopod.errors import ParameterError
from chilopod.live.wishes import LARGEST_SEED
from chilopod.robot import Robot

Array = NDArray[np.float64]

SPEEDS = (1.0, 20.0)
"""Slowest and fastest, times real time."""

FRICTIONS = (0.3, 3.0)
"""Range of the friction, relative to the robot file."""

STRIDES = (0.2, 1.5)
"""Range of the stride, relative to the robot file."""


@dataclass(frozen=True)
class Seen:
    """State of a walk at an instant.

    Attributes
    ----------
    time
        Since the last reset, s.
    clock
        To which the gait steps, s: at 0 it was at phase 0.
    robot
        Robot that walks, with its floor and steps; its springs may have changed since.
    status
        ``WALKED`` while it walks.
    pose
        x, y (m) and heading (rad) of module 1.
    joint_angles, stiffness
        Joint angles and stiffness of the yaw joints, now: rad and N*m/rad, (N-1,).
    leg_yaw
        Leg yaw of the legs of module 1, rad, (2,).
    mean_angles
        Mean angles of the joints over the last gait cycle, rad, (N-1,).
    turning
        By how much the sum of their sizes grows, rad/s.
    pulled
        Torques by which somebody pulls at joints, N*m, (N-1,).
    target
        Place of the target, m; None without one.
    steering
        Name of the strategy that steers there, which is leg yaw while those of springs are not known; else empty.
    state
        As ``initial`` of the engine's ``start`` takes it, (n,).
    """

    time: float
    clock: float
    robot: Robot
    status: Status
    pose: Array
    joint_angles: Array
    stiffness: Array
    leg_yaw: Array
    mean_angles: Array
    turning: float
    pulled: Array
    target: tuple[float, float] | None
    steering: str
    state: Array

    @property
    def bend(self) -> float:
        """Sum of the sizes of the mean angles, rad: the paper's measure."""
        return float(np.abs(self.mean_angles).sum())


@dataclass(frozen=True)
class Settings:
    """How everything is set.

    Attributes
    ----------
    robot
        As it is to walk: with the springs, the floor and the steps that were asked for.
    friction, stride
        Factor on the floor of the file; m.
    strategy, speed, paused, seed
        As asked for.
    recording
        True if the walk is being written down, or about to be.
    """

    robot: Robot
    friction: float
    stride: float
    strategy: str
    speed: float
    paused: bool
    seed: int
    recording: bool


def as_seed(seed: object) -> int:
    """A whole number, 0 to :data:`chilopod.live.wishes.LARGEST_SEED`, typed as it may be.

    Raises
    ------
    ParameterError
        If it is not.
    """
    number = as_finite("seed", seed)
    if number != int(number) or not 0 <= number <= LARGEST_SEED:
        allowed = f"a whole number, 0 to {LARGEST_SEED}"
        raise ParameterError("is no seed", field="seed", value=seed, allowed=allowed)
    return int(number)


def as_finite(field: str, value: object) -> float:
    """A finite number.

    Raises
    ------
    ParameterError
        If it is not, naming the field.
    """
    try:
        number = math.nan if isinstance(value, bool) or not isinstance(value, int | float) else float(value)
    except OverflowError:  # an int may have any number of digits
        number = math.inf
    if not math.isfinite(number):
        raise ParameterError("is no number", field=field, value=value, allowed="a finite number")
    return number


def as_within(field: str, value: object, limits: tuple[float, float], unit: str) -> float:
    """A number between two others.

    Raises
    ------
    ParameterError
        If it is not, naming the field and what is allowed.
    """
    number = as_finite(field, value)
    low, high = limits
    # The ends of a slider are those of its range up to round-off.
    if not low * (1.0 - 1e-9) <= number <= high * (1.0 + 1e-9):
        raise ParameterError("is out of range", field=field, value=value, allowed=f"{low:g} to {high:g} {unit}")
    return number
