"""Whole walks of many robots at a time in three dimensions, straight or steered, as a record over time."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr
from numpy.typing import ArrayLike

from chilopod.engine import Controller, steer
from chilopod.engine.batch import with_end
from chilopod.progress import Progress, silent
from chilopod.record import LONGEST, RATE, Recording, in_range
from chilopod.robot import Robot
from chilopod.twin.start import start
from chilopod.twin.walk import TOLERANCE


def simulate(
    robots: Robot | Sequence[Robot],
    duration: float,
    *,
    initial: ArrayLike | None = None,
    friction: ArrayLike | None = None,
    controller: Controller | None = None,
    target: ArrayLike | None = None,
    seeds: Sequence[int] | None = None,
    rate: float = RATE,
    forces: bool = False,
    poses: bool = False,
    threads: int = 0,
    tolerance: float = TOLERANCE,
    progress: Progress = silent,
) -> xr.Dataset:
    """Simulate walks of robots on the floor; the robots do not interact.

    The dataset is as that of :func:`chilopod.planar.simulate`, with ``leg_yaw`` as measured at the joints, not as
    commanded; with a target and a controller also ``seen_bearing`` and ``seen_distance`` over (event, robot), observed
    by the controller, NaN where the pole was out of view; with ``poses``, ``pose`` over (time, robot, coordinate).

    Parameters
    ----------
    robots, initial, friction, target, seeds, threads, tolerance
        As for :func:`start`.
    duration, forces, progress
        As for :func:`chilopod.planar.simulate`.
    controller
        Controller, called at its events; its commands act from the next servo target on.
    rate
        Samples per second, taken at the nearest step.
    poses
        True to add the positions of all joints, from which the robot can be drawn.
    """
    in_range("duration", duration, LONGEST, "s")
    recording = Recording(rate, forces, poses)
    walk = start(
        robots,
        initial=initial,
        friction=friction,
        target=target,
        seeds=seeds,
        record=recording,
        threads=threads,
        tolerance=tolerance,
        expected=duration,
    )
    steer(walk, duration, controller, progress=progress)
    return with_end(walk.to_dataset(copy=False), walk, recording)
