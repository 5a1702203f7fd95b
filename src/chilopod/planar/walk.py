"""Planar walks of many robots at a time, advanced step by step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from chilopod.engine import Command, Observation, Status, Traits, one_thread
from chilopod.engine.arguments import (
    BEGINNING,
    as_marks,
    as_robot,
    as_robots,
    check_time,
    check_wishes,
    rows_anew,
    standing,
)
from chilopod.engine.batch import BatchWalk, Beginning, begin, resumed
from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.planar import stretch
from chilopod.planar.model import PlanarModel
from chilopod.planar.record import foot_forces, planar_record
from chilopod.planar.step_count import check_steps
from chilopod.planar.timeline import Timeline
from chilopod.record import Recording, Samples, bearing_and_distance, check_size, in_range
from chilopod.robot import Robot

TOLERANCE = 1e-6
"""Default of :func:`start`: a minute of walking is then accurate to 1e-6 m."""

traits = Traits(
    name="planar",
    sentence="the paper's planar model",
    exact=True,
    threads=True,
    robots_per_core=32,
    walks_per_round=48,
    duration_ratio=1.6,
)

_STATUS = {
    stretch.WALKING: Status.WALKED,
    stretch.DIVERGED: Status.DIVERGED,
    stretch.OUT_OF_RANGE: Status.OUT_OF_RANGE,
    stretch.HALTED: Status.HALTED,
}


def common(robot: Robot) -> tuple[Any, ...]:
    """Properties that robots of a batch share, see :class:`chilopod.engine.Engine`: gait and number of modules."""
    return as_robot(robot).gait, robot.body.modules


def initial_states(
    robot: Robot, joint_angles: ArrayLike = 0.0, heading: ArrayLike = 0.0, position: ArrayLike = (0.0, 0.0)
) -> Array:
    """States of robots that are about to walk: at the speed of the straight walk, and at rest in their joints.

    Parameters
    ----------
    robot, joint_angles, heading, position
        See :class:`chilopod.engine.Engine`.

    Returns
    -------
    Shape (robots, 2N+4): reduced state (see :mod:`chilopod.planar.dynamics`), then x, y and heading.
    """
    angles, headings, places = standing(robot, joint_angles, heading, position)
    n = robot.body.modules
    states = np.zeros((len(angles), 2 * n + 4))
    states[:, 0] = robot.gait.speed
    states[:, 3 : n + 2] = angles
    states[:, 2 * n + 1 : 2 * n + 3] = places
    states[:, 2 * n + 3] = headings
    return states


def start(
    robots: Robot | Sequence[Robot],
    *,
    initial: ArrayLike | None = None,
    friction: ArrayLike | None = None,
    target: ArrayLike | None = None,
    seeds: Sequence[int] | None = None,
    record: Recording | None = Recording(),  # noqa: B008  (frozen)
    tolerance: float = TOLERANCE,
    expected: float = 0.0,
) -> PlanarWalk:
    """Start walks on the plane, see :class:`chilopod.engine.Engine`.

    Parameters
    ----------
    robots, friction, target, record, expected
        See :class:`chilopod.engine.Engine`. Robots share gait and number of modules and may differ in everything else.
    initial
        States with poses, shape (walks, 2N+4) or (2N+4,), from :func:`initial_states` or ``states`` of a walk.
    seeds
        Not used: observations have no noise here.
    tolerance
        Tolerance of every step, relative to max(1, |state|).
    """
    tolerance, expected = in_range("tolerance", tolerance, 1e-2), check_wishes(record, expected)
    given = as_robots(robots)
    if record is not None and record.poses:
        raise ParameterError("must be False: only the engine twin records poses in space", field="poses", value=True)
    if any(common(robot) != common(given[0]) for robot in given[1:]):
        raise ParameterError("must have the same gait and number of modules", field="robots")
    standing_still = initial_states(given[0])
    begun = begin(given, standing_still, standing_still.shape[1], initial, friction, target, seeds)
    return PlanarWalk(begun, record, tolerance, expected)


def resume(saved: bytes) -> PlanarWalk:
    """Continue a saved walk, see :class:`chilopod.engine.Engine`."""
    return resumed(traits, saved, PlanarWalk)


@one_thread
class PlanarWalk(BatchWalk):
    """Walk on the plane, see :class:`chilopod.engine.Walk`; made by :func:`start`.

    A target is visible in every direction. The yaw of a leg that stands changes at once here, and that of a leg that
    swings before it touches down.
    """

    def __init__(self, begun: Beginning, record: Recording | None, tolerance: float, expected: float = 0.0) -> None:
        robots, states = begun.robots, begun.states
        distinct = {id(robot): robot for robot in robots}
        for robot in distinct.values():
            check_steps(robot, expected)
        super().__init__(traits, begun, record, tolerance, expected, states.size)
        models = {key: PlanarModel(robot) for key, robot in distinct.items()}
        self._models = [models[id(robot)] for robot in robots]
        self._modules = self._models[0].modules
        self._own_friction = np.array([robot.ground.friction for robot in robots])[:, None, None]
        self._friction = self._own_friction * self._factors
        schedule = self._models[0].schedule
        self._feet = schedule.contact, schedule.stroke
        self._bodies = (
            np.concatenate([model.scalars for model in self._models]),
            np.array([(robot.legs.forward_offset, robot.legs.half_width) for robot in robots]),
            np.array([robot.springs.damping for robot in robots]),
        )
        self._timeline = Timeline(schedule, record.rate if record else 0.0)
        self._states, self._step = states, np.zeros(len(robots))
        self._status = np.full(len(robots), stretch.WALKING)
        # Copy of states, steps and statuses at the present time, or at a later one that is foreseen.
        self._here: tuple[Array, Array, NDArray[np.intp]] | None = None
        self._ahead: tuple[float, Array] | None = None  # that time, s, and the position of the timeline there
        self._samples = Samples(states.shape, self._expected_rows)
        if record:
            self._samples.grown(1)[0] = states

    @property
    def status(self) -> tuple[Status, ...]:
        """Status of each robot at the last switch or sample."""
        return tuple(_STATUS[int(each)] for each in self._status)

    def observe(self) -> Observation:
        states, n = self._seen(), self._modules
        place, heading = states[:, 2 * n + 1 : 2 * n + 3], states[:, 2 * n + 3]
        return self._observation(*bearing_and_distance(place, heading, self._targets.present), states[:, 3 : n + 2])

    def pose(self) -> Array:
        first, sample = 2 * self._modules + 1, self._sample_ahead()
        if sample < 0:
            return self._seen(first)
        pose = self._samples.grown(0)[sample, :, first:].copy()
        pose[self._status != stretch.WALKING] = np.nan
        return pose

    def aim(self, target: ArrayLike) -> None:
        self._targets.move(self._time, target)

    def halt(self, which: NDArray[np.bool_]) -> None:
        marked, sample = as_marks("which", which, len(self._robots)), self._sample_ahead()
        if sample < 0:
            for final, here in zip((self._states, self._step, self._status), self._now(), strict=True):
                final[marked] = here[marked]
        else:
            self._samples.grown(0)[sample + 1 :, marked] = np.nan
        marked &= self._status == stretch.WALKING
        self._status[marked] = stretch.HALTED
        if self._here is not None:
            self._here[-1][marked] = stretch.HALTED

    def states(self) -> Array:
        return self._seen()

    def restart(
        self,
        which: NDArray[np.bool_],
        initial: ArrayLike,
        friction: ArrayLike | None = None,
        seeds: Sequence[int] | None = None,
    ) -> None:
        arguments = {"initial": (initial, self._states.shape[1:]), "friction": (friction, self._factors.shape[1:])}
        marked, rows = rows_anew(which, self._robots, self._time, self._record, arguments, seeds)
        # All robots are at the switch that begins the cycle, however time was rounded: a walk stops for good there.
        self._here = None
        if rows["friction"] is not None:
            self._factors[marked] = rows["friction"]
            self._friction[marked] = self._own_friction[marked] * self._factors[marked]
        if rows["initial"] is not None:
            self._states[marked], self._step[marked], self._status[marked] = rows["initial"], 0.0, stretch.WALKING
            self._actuators.restart(marked)

    def command(self, command: Command) -> None:
        here = self._now()
        gait = self._robots[0].gait
        phase = gait.phases(self._time, 1)[0]
        swing = np.where(phase < gait.duty - BEGINNING, 0.0, (1.0 - phase) * gait.period)
        self._actuators.command(self._time, command, here[-1] == stretch.WALKING, swing)
        self._states, self._step, self._status = here
        if self._ahead is not None:
            self._timeline.position, self._ahead = self._ahead[1], None
        self._timeline.cut_at(self._time)
        self._here = None

    def advance(self, until: float) -> None:
        until = check_time(until, self._time)
        check_size(self._record, until, self._states.size)
        self._time = until
        if self._ahead is None or until > self._ahead[0]:
            self._ahead = self._here = None
            self._carry(self._timeline.pieces(until), self._states, self._step, self._status)

    def foresee(self, until: float) -> None:
        """See :class:`chilopod.engine.contract.Foresees`; nothing is kept without a record, or if a robot fails."""
        until = check_time(until, self._time)
        self._settle()
        if self._record is None:
            return
        behind, here = self._timeline.position.copy(), (self._states.copy(), self._step.copy(), self._status.copy())
        self._carry(self._timeline.pieces(until, rest=True), *here)
        # Whether a robot failed before the last cut, or behind it, decides what is seen of it.
        if (here[-1] == self._status).all():
            self._here, self._ahead = here, (until, self._timeline.position)
        self._timeline.position = behind
        if self._ahead is None:
            self._samples.cut(self._timeline.samples)

    def _saved(self) -> tuple[dict[str, Any], dict[str, Any]]:
        self._settle()
        return {}, {
            "states": self._states,
            "step": self._step,
            "status": self._status,
            "position": self._timeline.position,
            "samples": self._samples.rows,
        }

    def restore(self, settings: dict[str, Any], arrays: dict[str, Any]) -> None:
        super().restore(settings, arrays)
        self._step, self._status = arrays["step"], arrays["status"]
        self._timeline.position = arrays["position"]
        if len(arrays["samples"]):
            self._samples.grown(len(arrays["samples"]))[:] = arrays["samples"]

    def to_dataset(self, copy: bool = True) -> xr.Dataset:
        """Record so far, see :func:`chilopod.planar.simulate`; without a copy if the walk ends here."""
        self._settle()
        rate = self._record.rate if self._record else 1.0
        # A sample that follows the present within rounding is taken already, but does not count yet.
        count = min(self._timeline.samples, len(self._record.samples(self._time)) if self._record else 0)
        states = self._samples.grown(0)[:count]
        times = np.arange(len(states)) / rate
        leg_yaw = self._actuators.leg_yaw_over(times)
        data = planar_record(self._models[0], times, states, leg_yaw).copy(deep=copy)
        forces = {}
        if self._record and self._record.forces:
            acting = self._actuators.leg_yaw_commanded(times)
            forces["foot_force"] = foot_forces(self._models, times, states, acting, self._friction)
        self._finish(data, times, forces)
        data.attrs["tolerance"] = self._tolerance
        return data

    # -- inside
    # ---------------------------------------------------------------------------------------------------------------

    def _now(self) -> tuple[Array, Array, NDArray[np.intp]]:
        """States, steps and statuses at the present time; a copy unless there is a cut."""
        if self._ahead is not None and self._here is not None and self._time == self._ahead[0]:
            return self._here
        self._settle()
        if self._timeline.is_at_cut(self._time):
            return self._states, self._step, self._status
        if self._here is None:
            self._here = self._states.copy(), self._step.copy(), self._status.copy()
            self._carry(self._timeline.pieces(self._time, rest=True), *self._here)
        return self._here

    def _settle(self) -> None:
        """Drop what was foreseen, and advance to the present time instead."""
        if self._ahead is not None:
            self._ahead = self._here = None
            self._carry(self._timeline.pieces(self._time), self._states, self._step, self._status)
            self._samples.cut(self._timeline.samples)

    def _sample_ahead(self) -> int:
        """Number of the sample at the present time if a later one is foreseen, otherwise -1."""
        ahead = self._ahead is not None and self._time < self._ahead[0]
        return self._timeline.sample_at(self._time) if ahead else -1

    def _seen(self, first: int = 0) -> Array:
        """Copy of the states at the present time from a column on, NaN for robots that no longer walk."""
        states, _, status = self._now()
        # Failures are judged where the walk stops for good; a robot that cannot be integrated further has NaN.
        gone = (self._status != stretch.WALKING) | (status == stretch.DIVERGED)
        return np.where(gone[:, None], np.nan, states[:, first:])

    def _carry(
        self, pieces: tuple[Any, Any, Any, Any, Any], states: Array, step: Array, status: NDArray[np.intp]
    ) -> None:
        """Carry all robots through pieces of time, in place."""
        record, actuators = self._samples.grown(self._timeline.samples if self._record else 0), self._actuators
        rows = np.flatnonzero(status == stretch.WALKING)
        if not rows.size or not len(pieces[0]):
            return
        commands = actuators.profile, actuators.lag, actuators.joint_torque, actuators.leg_yaw
        robots, when = stretch.Robots(*self._bodies, self._friction, *commands), stretch.Pieces(*pieces, *self._feet)
        stretch.carry(rows, when, robots, self._tolerance, states, step, status, record)
