"""What a batch of walks needs to begin: robots that go together, where they start, their floor and their targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import ParameterError
from chilopod.record import LONGEST, MOST_NUMBERS
from chilopod.robot import Robot
from chilopod.twin.model import TwinModel, compiled, without_springs

Array = NDArray[np.float64]


def initial_states(
    robot: Robot,
    joint_angles: ArrayLike = 0.0,
    heading: ArrayLike = 0.0,
    position: ArrayLike = (0.0, 0.0),
) -> Array:
    """States of robots that are about to walk: at rest, feet where the gait has them at time 0.

    Parameters
    ----------
    robot
        With a twin.
    joint_angles
        Of the yaw joints, rad, shape (N-1,) or (robots, N-1).
    heading
        Of module 1, rad, a number or shape (robots,).
    position
        Of its centre, m, shape (2,) or (robots, 2).

    Returns
    -------
    Positions of all joints (MuJoCo's ``qpos``), shape (robots, nq).
    """
    plan = compiled(robot)
    joints = len(plan.yaw_positions)
    angles = np.atleast_2d(np.asarray(joint_angles, dtype=np.float64))
    angles = np.broadcast_to(angles, (len(angles), joints))
    heading, position = np.atleast_1d(np.asarray(heading, float)), np.atleast_2d(np.asarray(position, float))
    count = np.broadcast_shapes(angles.shape[:1], heading.shape, position.shape[:1])[0]
    states = np.tile(plan.initial_positions(), (count, 1))
    states[:, :2] = position
    states[:, 3], states[:, 6] = np.cos(0.5 * heading), np.sin(0.5 * heading)
    states[:, plan.yaw_positions] = angles
    return states


@dataclass(frozen=True)
class Plan:
    """Checked arguments, one row a walk."""

    model: TwinModel
    robots: list[Robot]
    states: Array
    friction: Array
    target: Array | None
    scan_seeds: list[int] | None


def checked_plan(
    robots: Robot | Sequence[Robot],
    duration: float,
    initial: ArrayLike | None,
    friction: ArrayLike | None,
    target: ArrayLike | None,
    scan_seeds: Sequence[int] | None,
    rate: float,
    forces: bool,
) -> Plan:
    """Arguments of :func:`chilopod.twin.simulate`, checked.

    Raises
    ------
    ParameterError
        If one has the wrong shape or is out of range, or the robots do not go together.
    """
    for name, value, most in (("duration", duration, LONGEST), ("rate", rate, 1e6)):
        if not 0.0 < value <= most:
            raise ParameterError("is out of range", field=name, value=value, allowed=f"more than 0, at most {most:g}")
    given = [robots] if isinstance(robots, Robot) else list(robots)
    if not given:
        raise ParameterError("there are none", field="robots", allowed="at least one")
    first = given[0]
    if any(without_springs(each) != without_springs(first) for each in given):
        raise ParameterError("may differ in their springs only", field="robots")
    model = compiled(without_springs(first), forces)
    shapes = {"initial": (model.model.nq,), "friction": (first.body.modules, 2), "target": (2,)}
    rows: dict[str, Array] = {}
    seeds = None if scan_seeds is None else list(scan_seeds)
    if seeds is not None and min(seeds, default=-1) < 0:
        raise ParameterError("must be whole numbers, one a walk", field="scan_seeds", allowed="0 or more")
    counts = {len(given), len(seeds or [0])}
    for name, argument in (("initial", initial), ("friction", friction), ("target", target)):
        if argument is None:
            continue
        array, shape = np.asarray(argument, dtype=np.float64), shapes[name]
        if array.shape[array.ndim - len(shape) :] != shape or array.ndim > len(shape) + 1 or array.size == 0:
            allowed = f"{shape} or (walks, {', '.join(map(str, shape))})"
            raise ParameterError("has the wrong shape", field=name, value=array.shape, allowed=allowed)
        if not np.isfinite(array).all():
            raise ParameterError("must be finite", field=name)
        rows[name] = array if array.ndim > len(shape) else array[None]
        counts.add(len(rows[name]))
    counts.discard(1)
    if len(counts) > 1:
        raise ParameterError("do not agree in number", field="robots, initial, friction, target", value=sorted(counts))
    count = counts.pop() if counts else 1
    if count * duration * rate * (model.model.nq + model.model.nv) > MOST_NUMBERS:
        raise ParameterError(
            "the record would be too large", field="rate", value=rate, allowed="fewer robots, samples or seconds"
        )
    if "friction" in rows and not (rows["friction"] > 0.0).all():
        raise ParameterError("must be positive", field="friction")

    def spread(name: str, default: Array) -> Array:
        return np.array(np.broadcast_to(rows.get(name, default[None]), (count, *shapes[name])))

    return Plan(
        model,
        given * (count if len(given) == 1 else 1),
        spread("initial", initial_states(first)[0]),
        spread("friction", np.ones(shapes["friction"])),
        spread("target", np.zeros(2)) if target is not None else None,
        None if seeds is None else seeds * (count if len(seeds) == 1 else 1),
    )
