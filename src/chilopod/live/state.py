"""Visible state of a live walk, its settings, and checks of numbers in wishes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from chilopod.engine import Status
from chilopod.engine.arguments import require
from chilopod.frozen import Array
from chilopod.live.wishes import LARGEST_SEED
from chilopod.robot import Robot

_ONE_WAY, _ALONG = 0.8, 1.0 / 3.0  # of the bend of a curve: on one side, and different from the turn of its path


@dataclass(frozen=True)
class Seen:
    """State of a walk at an instant; a robot has N modules."""

    time: float  #: s since the last reset
    clock: float  #: s, of the gait, which is at phase 0 at 0
    robot: Robot  #: with its floor and steps; its springs may have changed since
    status: Status  #: WALKED while it goes on
    pose: Array  #: x, y (m) and heading (rad) of module 1
    joint_angles: Array  #: rad, (N-1,)
    stiffness: Array  #: of the yaw joints, N*m/rad, (N-1,)
    leg_yaw: Array  #: of the legs of module 1, rad, (2,)
    mean_angles: Array  #: of the joints over the last gait cycle, rad, (N-1,)
    turning: float  #: rate at which the sum of their sizes grows, rad/s
    pulled: Array  #: torques by which somebody pulls at joints, N*m, (N-1,)
    target: tuple[float, float] | None  #: m
    steering: str  #: name of the strategy that steers there: leg yaw while those of springs are not known; "" for none
    state: Array  #: as ``initial`` of the engine's ``start`` takes it, (n,)
    undulates: bool  #: True if it bends from side to side, so that its mean is no curve
    turned: float  #: by which module 1 turned while it walked the last length of the axis, rad; NaN before that

    @property
    def bend(self) -> float:
        """Sum of the sizes of the mean angles, rad: the paper's measure."""
        return float(np.abs(self.mean_angles).sum())

    @property
    def one_way(self) -> bool:
        """True if nearly all of the bend is to one side."""
        return abs(float(self.mean_angles.sum())) > _ONE_WAY * self.bend

    @property
    def curves(self) -> bool:
        """True if the body lies on a curve, along the path that it has walked."""
        return self.one_way and not self.undulates and bool(abs(self.turned / self.mean_angles.sum() + 1.0) < _ALONG)


@dataclass(frozen=True)
class Settings:
    """Wishes that were granted."""

    robot: Robot  #: with the springs, floor and steps that it is to walk with
    friction: float  #: of the floor, relative to that of the file
    strategy: str  #: name of one of :data:`chilopod.steering.ON_THE_WAY`
    speed: float  #: seconds of walking a second
    paused: bool  #: True if it stands still
    seed: int  #: of start and nudges
    recording: bool  #: True if the walk is being recorded, or about to be


def but_springs(robot: Robot) -> tuple[object, ...]:
    """Numbers of a robot that change between two gait cycles only."""
    return robot.body, robot.legs, robot.gait, robot.ground, robot.twin


def as_seed(seed: object) -> int:
    """A whole number, 0 to :data:`chilopod.live.wishes.LARGEST_SEED`; a ParameterError if it is not."""
    number = as_finite("seed", seed)
    whole = number == int(number) and 0 <= number <= LARGEST_SEED
    require(whole, "must be a whole number", "seed", seed, f"0 to {LARGEST_SEED}")
    return int(number)


def as_finite(field: str, value: object) -> float:
    """A finite number; a ParameterError with the name of the field if it is not."""
    try:
        number = math.nan if isinstance(value, bool) or not isinstance(value, int | float) else float(value)
    except OverflowError:  # an int may have any number of digits
        number = math.inf
    require(math.isfinite(number), "must be a finite number", field, value)
    return number


def as_within(field: str, value: object, limits: tuple[float, float], unit: str) -> float:
    """Checked number between two others; a ParameterError names the field and the allowed range."""
    number, (low, high) = as_finite(field, value), limits
    # The ends of a slider are those of its range up to round-off.
    fits = low * (1.0 - 1e-9) <= number <= high * (1.0 + 1e-9)
    require(fits, "is out of range", field, value, f"{low:g} to {high:g} {unit}".strip())
    return number
