"""Walks of many robots at a time, straight on or steered, as a record over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from chilopod.engine import Controller, Observation, Status, bearing_and_distance, event_times
from chilopod.errors import ParameterError
from chilopod.planar import stretch
from chilopod.planar.model import PlanarModel
from chilopod.planar.pieces import pieces
from chilopod.planar.record import foot_forces, planar_record
from chilopod.record import LONGEST, MOST_NUMBERS, RATE, add_outcome, leg_yaw_at
from chilopod.robot import Robot

Array = NDArray[np.float64]

TOLERANCE = 1e-6
"""Default of :func:`simulate`: a minute of walking is then good to better than 1e-6 m."""

_STATUS = {
    stretch.WALKING: Status.WALKED,
    stretch.DIVERGED: Status.DIVERGED,
    stretch.OUT_OF_RANGE: Status.OUT_OF_RANGE,
}
_SAME_INSTANT = 1e-10  # s


def initial_states(
    robot: Robot,
    joint_angles: ArrayLike = 0.0,
    heading: ArrayLike = 0.0,
    position: ArrayLike = (0.0, 0.0),
) -> Array:
    """States of robots that are about to walk: at the speed of the straight walk, and at rest in their joints.

    Parameters
    ----------
    robot
        Size and gait.
    joint_angles
        rad, shape (N-1,) or (robots, N-1).
    heading
        Of module 1, rad, a number or shape (robots,).
    position
        Of its centre, m, shape (2,) or (robots, 2).

    Returns
    -------
    Shape (robots, 2N+4): reduced state (see :mod:`chilopod.planar.dynamics`), then x, y and heading.
    """
    n = robot.body.modules
    angles = np.atleast_2d(np.asarray(joint_angles, dtype=np.float64))
    angles = np.broadcast_to(angles, (len(angles), n - 1))
    heading, position = np.atleast_1d(np.asarray(heading, float)), np.atleast_2d(np.asarray(position, float))
    count = np.broadcast_shapes(angles.shape[:1], heading.shape, position.shape[:1])[0]
    states = np.zeros((count, 2 * n + 4))
    states[:, 0] = robot.gait.speed
    states[:, 3 : n + 2] = angles
    states[:, 2 * n + 1 : 2 * n + 3] = position
    states[:, 2 * n + 3] = heading
    return states


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
    progress: Callable[[float, str], None] = lambda done, words: None,
) -> xr.Dataset:
    """Let robots walk on the plane; each one alone, all of them at the same time.

    Parameters
    ----------
    robots
        One, or one for every walk; they share gait and number of modules and may differ in all else.
    duration
        s; the gait is at phase 0 at time 0.
    initial
        States with poses, shape (walks, 2N+4) or (2N+4,), such as :func:`initial_states` gives; by default the straight
        walk from the origin along x.
    friction
        Factor on the friction coefficient of every foot, positive, shape (N, 2) or (walks, N, 2).
    controller
        Asked for leg yaw at its events; without one the legs stay straight. In this model a leg's yaw moves at once and
        matters only while its foot stands.
    target
        Its place on the floor, m, shape (2,) or (walks, 2), for the controller to see.
    bearing_noise
        What is added to the bearing that the controller sees at its events, rad, shape (walks, at least as many as
        events); the last axis is the order of events.
    rate
        Samples per second.
    tolerance
        Of every step, relative to max(1, |state|).
    forces
        Whether to add the force on every foot.
    progress
        Called with the part done (0 to 1) and a few words.

    Returns
    -------
    Dataset over time, robot (the walk), joint (1 .. N-1), side and axis: ``position`` and ``velocity`` of the centre of
    module 1 on the floor, ``heading``, ``heading_rate``, ``joint_angle``, ``joint_rate``, ``leg_yaw`` (at this moment),
    ``status``; with a target, ``target``, ``distance`` and ``bearing``; with a controller, ``command`` (leg yaw asked
    for) over (event, robot, side), which is reached ``within`` (event) s; with ``forces``, ``foot_force`` on the robot
    over (time, robot, module, side, axis), on the floor's axes. From where a walk fails on it is NaN, and ``status``
    tells why. Units in attributes.

    Raises
    ------
    ParameterError
        If an argument has the wrong shape or is out of range, or the robots do not go together.
    """
    plan = _plan(robots, duration, initial, friction, target, rate, tolerance)
    models, states, count = plan.models, plan.states, len(plan.models)
    gait, n = models[0].robot.gait, models[0].modules
    last_sample = np.floor(duration * rate * (1.0 + 1e-12))
    if (last_sample + 1) * states.size > MOST_NUMBERS:
        raise ParameterError(
            "the record would be too large", field="rate", value=rate, allowed="fewer robots, samples or seconds"
        )
    samples = np.arange(int(last_sample) + 1) / rate
    asked = event_times(controller, gait, duration) if controller else []
    noise = np.zeros((count, len(asked))) if bearing_noise is None else np.atleast_2d(np.asarray(bearing_noise, float))
    if noise.ndim != 2 or len(noise) != count or noise.shape[1] < len(asked):
        raise ParameterError(
            "has the wrong shape", field="bearing_noise", value=noise.shape, allowed=f"({count}, {len(asked)} or more)"
        )

    schedule = models[0].schedule
    parameters = [
        np.concatenate([model.scalars for model in models]),
        np.array([(m.robot.legs.forward_offset, m.robot.legs.half_width) for m in models]),
        np.stack([model.stiffness for model in models]),
        np.stack([model.damping for model in models]),
        plan.friction,
    ]
    record = np.full((samples.size, count, 2 * n + 4), np.nan)
    record[0] = states
    status = np.full(count, stretch.WALKING)
    step = np.zeros(count)
    yaw = np.zeros((count, 2))
    commands, reached_within = np.empty((len(asked), count, 2)), np.empty(len(asked))
    cuts = np.array([0.0, *(t for t, _ in asked), duration])
    for index, (start, end) in enumerate(zip(cuts[:-1], cuts[1:], strict=True)):
        if index:
            t, event = asked[index - 1]
            seen = _observed(t, states, yaw, plan.target, noise[:, index - 1], n)
            # Robots that no longer walk see nothing.
            seen.bearing[status != stretch.WALKING] = np.nan
            assert controller is not None
            command = controller.act(event, seen)
            yaw = np.where(status[:, None] == stretch.WALKING, command.leg_yaw, yaw)
            commands[index - 1], reached_within[index - 1] = yaw, command.within
        if end > start:
            starts, widths, interval = pieces(gait, n, start, end)
            cut = _cut(start, starts, widths, interval, samples)
            stretch.walk(
                *cut, schedule.contact, schedule.stroke, *parameters, yaw, tolerance, states, step, status, record
            )
        progress((index + 1) / (len(cuts) - 1), f"{end:.1f} s")
    leg_yaw = leg_yaw_at(samples, asked, commands, reached_within, count)
    data = planar_record(models[0], samples, record, leg_yaw)
    statuses = [_STATUS[int(each)] for each in status]
    add_outcome(data, statuses, plan.target, asked if controller else None, commands, reached_within)
    if forces:
        data["foot_force"] = foot_forces(models, samples, record, leg_yaw, plan.friction)
    data.attrs = {"engine": "planar", "robot": models[0].robot.to_toml(), "duration": duration, "tolerance": tolerance}
    return data


@dataclass(frozen=True)
class _Plan:
    """Checked arguments, one row a walk."""

    models: list[PlanarModel]
    states: Array
    friction: Array
    target: Array | None


def _plan(
    robots: Robot | Sequence[Robot],
    duration: float,
    initial: ArrayLike | None,
    friction: ArrayLike | None,
    target: ArrayLike | None,
    rate: float,
    tolerance: float,
) -> _Plan:
    for name, value, most in (("duration", duration, LONGEST), ("rate", rate, 1e6), ("tolerance", tolerance, 1e-2)):
        if not 0.0 < value <= most:
            raise ParameterError("is out of range", field=name, value=value, allowed=f"more than 0, at most {most:g}")
    given = [robots] if isinstance(robots, Robot) else list(robots)
    if not given:
        raise ParameterError("there are none", field="robots", allowed="at least one")
    n = given[0].body.modules
    shapes = {"initial": (2 * n + 4,), "friction": (n, 2), "target": (2,)}
    arrays: dict[str, Array | None] = {}
    count = len(given)
    for name, argument in (("initial", initial), ("friction", friction), ("target", target)):
        array = None if argument is None else np.asarray(argument, dtype=np.float64)
        shape = shapes[name]
        if array is not None:
            if array.shape[array.ndim - len(shape) :] != shape or array.ndim > len(shape) + 1:
                allowed = f"{shape} or (walks, {', '.join(map(str, shape))})"
                raise ParameterError("has the wrong shape", field=name, value=array.shape, allowed=allowed)
            if not np.isfinite(array).all():
                raise ParameterError("must be finite", field=name)
            if array.ndim > len(shape):
                if len(array) == 0:
                    raise ParameterError("there are none", field=name, allowed="at least one")
                if len(array) > 1:
                    if count > 1 and len(array) != count:
                        raise ParameterError("has the wrong length", field=name, value=len(array), allowed=str(count))
                    count = len(array)
        arrays[name] = array
    if friction is not None and not (np.asarray(friction) > 0.0).all():
        raise ParameterError("must be positive", field="friction")
    models = [PlanarModel(robot) for robot in (given * count if len(given) == 1 else given)]
    if not all(models[0].can_flow_with(model) for model in models):
        raise ParameterError("must have the same gait and number of modules", field="robots")
    initial = initial_states(given[0]) if initial is None else initial
    factors = np.ones((n, 2)) if arrays["friction"] is None else arrays["friction"]
    own = np.array([model.robot.ground.friction for model in models])
    return _Plan(
        models,
        np.array(np.broadcast_to(np.asarray(initial, dtype=np.float64), (count, 2 * n + 4))),
        own[:, None, None] * np.broadcast_to(factors, (count, n, 2)),
        None if arrays["target"] is None else np.array(np.broadcast_to(arrays["target"], (count, 2))),
    )


def _observed(t: float, states: Array, yaw: Array, target: Array | None, noise: Array, n: int) -> Observation:
    if target is None:
        bearing = distance = np.full(len(states), np.nan)
    else:
        bearing, distance = bearing_and_distance(states[:, 2 * n + 1 : 2 * n + 3], states[:, 2 * n + 3], target)
        bearing = (bearing + noise + np.pi) % (2.0 * np.pi) - np.pi
    return Observation(t, bearing, distance, states[:, 3 : n + 2].copy(), yaw.copy())


def _cut(
    start: float, starts: Array, widths: Array, interval: NDArray[np.intp], samples: Array
) -> tuple[Array, Array, NDArray[np.intp], NDArray[np.intp]]:
    """Pieces of a stretch, cut once more at the samples in it; and which sample each of them ends at, or -1."""
    edges = start + np.concatenate([[0.0], np.cumsum(widths)])
    low, high = np.searchsorted(samples, [start + _SAME_INSTANT, edges[-1] + _SAME_INSTANT])
    inside = samples[low:high]
    near = np.clip(np.searchsorted(edges, inside), 1, len(edges) - 1)
    near -= inside - edges[near - 1] < edges[near] - inside
    inside = np.where(np.abs(edges[near] - inside) < _SAME_INSTANT, edges[near], inside)
    cuts = np.union1d(edges, inside)
    parent = np.searchsorted(edges, cuts[:-1], side="right") - 1
    sample = np.full(len(cuts) - 1, -1)
    sample[np.searchsorted(cuts, inside) - 1] = np.arange(low, high)
    return starts[parent] + (cuts[:-1] - edges[parent]), np.diff(cuts), interval[parent], sample
