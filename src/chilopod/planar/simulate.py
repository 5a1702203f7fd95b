"""Whole walks of many robots at a time, straight on or steered, as a record over time."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr
from numpy.typing import ArrayLike

from chilopod.engine import Controller, steer
from chilopod.engine.batch import with_end
from chilopod.planar.walk import TOLERANCE, start
from chilopod.progress import Progress, silent
from chilopod.record import LONGEST, RATE, Recording, in_range
from chilopod.robot import Robot


def simulate(
    robots: Robot | Sequence[Robot],
    duration: float,
    *,
    initial: ArrayLike | None = None,
    friction: ArrayLike | None = None,
    controller: Controller | None = None,
    target: ArrayLike | None = None,
    bearing_noise: ArrayLike | None = None,
    rate: float = RATE,
    tolerance: float = TOLERANCE,
    forces: bool = False,
    progress: Progress = silent,
) -> xr.Dataset:
    """Simulate walks of robots on the plane; the robots do not interact.

    Parameters
    ----------
    robots, initial, friction, target, tolerance
        As for :func:`start`.
    duration
        Duration of the walks, s; the gait is at phase 0 at time 0.
    controller
        Controller, called at its events; None keeps the legs straight. In this model the yaw of a leg that stands
        changes at once, and that of a leg that swings before it touches down.
    bearing_noise
        Error added to the bearing that the controller sees at its events, rad, shape (walks, at least as many as
        events); the last axis is the order of events.
    rate
        Samples per second.
    forces
        True to add the force on every foot.
    progress
        Function of the fraction done (0 to 1) and a few words.

    Returns
    -------
    Dataset over time, robot (the walk), joint (1 .. N-1), side and axis: ``position`` and ``velocity`` of the centre of
    module 1 on the floor, ``heading``, ``heading_rate``, ``joint_angle``, ``joint_rate``, ``leg_yaw`` (at this moment),
    ``stiffness`` (over time if any spring is adjustable), ``status``; with a target, ``target``, ``distance`` and
    ``bearing``; with a controller, ``command`` (commanded leg yaw) over (event, robot, side), ``command_stiffness``
    (NaN where none was commanded) and ``command_torque``, reached ``within`` (event) s; with ``forces``, ``foot_force``
    on the robot over (time, robot, module, side, axis), on the floor's axes; where the end of the walks is no sample,
    ``end_position`` and ``end_joint_angle``. After the failure of a walk all is NaN,
    and ``status`` gives the reason. Attributes hold the units.

    Raises
    ------
    ParameterError
        If an argument has the wrong shape or is out of range, or the robots differ in gait or number of modules.
    """
    in_range("duration", duration, LONGEST, "s")
    recording = Recording(rate, forces)
    walk = start(
        robots,
        initial=initial,
        friction=friction,
        target=target,
        record=recording,
        tolerance=tolerance,
        expected=duration,
    )
    steer(walk, duration, controller, bearing_noise=bearing_noise, progress=progress)
    return with_end(walk.to_dataset(copy=False), walk, recording)
