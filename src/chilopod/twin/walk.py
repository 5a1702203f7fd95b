"""Walks of many robots at a time in three dimensions, advanced step by step."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import mujoco
import numpy as np
import xarray as xr
from mujoco.batch import Batch
from numpy.typing import ArrayLike, NDArray

from chilopod.cores import cores
from chilopod.engine import Command, Observation, Ramps, Status, Traits, one_thread
from chilopod.engine.arguments import as_array, as_marks, as_seeds, check_time, require, rows_anew
from chilopod.engine.batch import BatchWalk, Beginning
from chilopod.engine.contract import Marks
from chilopod.engine.saved import part
from chilopod.frozen import Array, read_only
from chilopod.record import Recording, Samples, check_size, quantity, walk_record
from chilopod.robot import Robot
from chilopod.twin.failures import failures
from chilopod.twin.legs import servo_targets, twin_of
from chilopod.twin.model import AWAY, SIDES, Edit, TwinModel, compiled, silence, without_springs
from chilopod.twin.scanner import Scanner, rotation

TOLERANCE = 1e-8
"""Default tolerance of the contact solver, MuJoCo's own."""

_LONGEST_STRETCH = 0.6  # s stepped without a check, with every step kept meanwhile
_MOST_KEPT = 5e7  # numbers, of these steps
_TARGETS_AHEAD = 2048  # ticks for which servo targets are computed at a time
_SAME_INSTANT = 1e-9  # ticks
_STATE = ("time", "qpos", "qvel", "qacc_warmstart", "qfrc_applied")
"""Fields of MuJoCo's state that differ between walks and are not set before every step."""


@dataclass(frozen=True)
class Sampling:
    """Samples at the steps nearest to their times, from samples per second, 0 for none, and the timestep, s."""

    rate: float
    timestep: float

    def steps(self, samples: NDArray[np.intp]) -> NDArray[np.intp]:
        """Steps of samples, of their shape."""
        return np.rint(samples / (self.rate or 1.0) / self.timestep).astype(np.intp)

    def count(self, step: int) -> int:
        """Number of samples up to a step."""
        if self.rate == 0.0 or step < 0:
            return 0
        in_a_step = self.rate * self.timestep
        near = int(step * in_a_step) + np.arange(-2, 4 + int(in_a_step))
        return int(near[self.steps(near) <= step][-1]) + 1


@one_thread
class TwinWalk(BatchWalk):
    """Walk on the floor, see :class:`chilopod.engine.Walk`; made by :func:`chilopod.twin.start`.

    Time advances in ticks, one for each control interval: a walk advances to the first tick that is not before the
    given time, and commands act from there. Observations of a target come from the scanner's last scan.
    """

    def __init__(
        self,
        begun: Beginning,
        record: Recording | None,
        tolerance: float,
        expected: float = 0.0,
        *,
        traits: Traits,
        threads: int,
        edit: Edit | None = None,
    ) -> None:
        robots, count = begun.robots, len(begun.robots)
        self._plan = plan = compiled(without_springs(robots[0]), bool(record and record.forces), edit)
        super().__init__(traits, begun, record, tolerance, expected, count * (plan.model.nq + plan.model.nv))
        self._edit = edit
        self._seeds = None if begun.seeds is None else np.array(begun.seeds, dtype=np.object_)
        self._batch = Batch(plan.model, count, threads or cores())
        self._springs = np.array([each.springs.stiffness for each in robots])
        self._batch.expand("jnt_stiffness")[:, plan.yaw_joints] = self._springs
        self._batch.expand("dof_damping")[:, plan.yaw_rates] = [each.springs.damping for each in robots]
        self._rub()
        self._batch.expand("opt.tolerance")[:] = tolerance
        self._put(np.arange(count), begun.states)
        self._scanner = Scanner(plan.twin, self._batch, self._seeds)
        self._put_poles()
        self._leg_yaw = Ramps(np.zeros((count, 2)))
        self._tick = 0
        self._status = np.full(count, Status.WALKED, dtype=object)
        self._gone = np.zeros(count, dtype=np.bool_)  # robots that no longer walk
        self._servos_from, self._servos = 0, np.empty((0, plan.leg_controls.size))
        self._seen: list[Array] = []

        self._sampling = Sampling(record.rate if record else 0.0, plan.twin.timestep)
        sizes = {"qpos": plan.model.nq, "qvel": plan.model.nv, "sensordata": plan.model.nsensordata}
        # Recorded quantities, by MuJoCo's name.
        self._kept = {name: Samples((count, size), self._expected_rows) for name, size in sizes.items() if size}
        start = self._sampling.count(0)  # several, if sampled more often than stepped
        for name in ("qpos", "qvel") if start else ():
            self._kept[name].grown(start)[:] = self._batch.bind(name)

    @property
    def _longest_stretch(self) -> int:
        """Number of ticks stepped at a time: at least one, limited by memory."""
        model, twin = self._plan.model, self._plan.twin
        numbers = model.nq + model.nv + model.nu + model.nsensordata
        most = _MOST_KEPT / (len(self._robots) * self._plan.steps_per_control * numbers)
        problem = f"must be shorter: no memory for {self._plan.steps_per_control:g} steps of {len(self._robots)} robots"
        given, allowed = twin.control_interval, f"{most * twin.control_interval:.2g} s or less with this timestep"
        require(most >= 1.0, problem, "twin.control_interval", f"{given:g} s", allowed)
        return max(1, int(min(_LONGEST_STRETCH / twin.control_interval, most)))

    @property
    def status(self) -> tuple[Status, ...]:
        """Status of each robot."""
        return tuple(self._status)

    def observe(self) -> Observation:
        angles = self._batch.bind("qpos")[:, self._plan.yaw_positions].copy()
        angles[self._gone] = np.nan
        bearing, distance = self._look()
        return self._observation(bearing, distance, angles)

    def pose(self) -> Array:
        places = self._batch.bind("qpos")[:, :7]
        pose = np.column_stack([places[:, :2], _heading(rotation(places[:, 3:]))])
        pose[self._gone] = np.nan
        return pose

    def aim(self, target: ArrayLike) -> None:
        """See :class:`chilopod.engine.Walk`; the last scan is repeated with the pole at its new position."""
        self._targets.move(self._time, target)
        self._put_poles()

    def halt(self, which: Marks) -> None:
        self._mark(as_marks("which", which, len(self._robots)) & ~self._gone, Status.HALTED)

    def states(self) -> Array:
        states = np.hstack([self._batch.bind("qpos"), self._batch.bind("qvel")])
        states[self._gone] = np.nan
        return states

    def restart(
        self, which: Marks, initial: ArrayLike, friction: ArrayLike | None = None, seeds: Sequence[int] | None = None
    ) -> None:
        """See :class:`chilopod.engine.Walk`; the times of the scans do not change."""
        size = (state_size(self._plan, initial),)
        arguments = {"initial": (initial, size), "friction": (friction, self._factors.shape[1:])}
        marked, rows = rows_anew(which, self._robots, self._time, self._record, arguments, seeds)
        states, ids = rows["initial"], np.flatnonzero(marked)
        noisy = seeds is None or self._seeds is not None
        require(noisy, "must be None: this walk has no noise", "seeds", allowed="None, or seeds at the start")
        if states is None:
            return
        self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE)
        self._put(ids, states)
        if rows["friction"] is not None:
            self._factors[ids] = rows["friction"]
            self._rub()
        if seeds is not None and self._seeds is not None:
            self._seeds[ids] = as_seeds(seeds)
        self._actuators.restart(marked)
        self._leg_yaw.restart(marked)
        self._mark(marked, Status.WALKED)
        self._scanner.restart(ids, anew=seeds is not None)
        self._put_poles()

    def command(self, command: Command) -> None:
        self._actuators.command(self._time, command, ~self._gone)
        if command.leg_yaw is not None:
            ticks = max(1, round(command.within / self._plan.twin.control_interval))
            self._leg_yaw.to(self._actuators.leg_yaw, self._tick, ticks)
        self._batch.bind("qfrc_applied")[:, self._plan.yaw_rates] = self._actuators.joint_torque
        if self._record is not None:
            self._seen.append(self._look())

    def advance(self, until: float) -> None:
        until = check_time(until, self._time)
        check_size(self._record, until, len(self._robots) * (self._plan.model.nq + self._plan.model.nv))
        interval = self._plan.twin.control_interval
        last, longest = int(np.ceil(until / interval - _SAME_INSTANT)), self._longest_stretch
        with silence():
            while self._tick < last:
                tick = min(last, self._tick + longest)
                if not self._gone.all():
                    self._step_to(tick)
                else:  # scans are counted all the same, for robots that are restarted
                    self._scanner.passed(self._tick, tick, np.empty((0, tick - self._tick, 7)), self._walking)
                self._tick = tick
        self._time = until
        if self._gone.all():
            # The record continues with NaN.
            for store in self._kept.values():
                store.grown(self._sampling.count(self._tick * self._plan.steps_per_control))

    def _maker(self) -> Any:
        return partial(TwinWalk, traits=self.traits, threads=0, edit=self._edit)

    def _saved(self) -> tuple[dict[str, Any], dict[str, Any]]:
        seeds = None if self._seeds is None else self._seeds.tolist()
        settings = {"seeds": seeds, "tick": self._tick, "status": [each.name for each in self._status]}
        return settings, {
            "states": self._batch.bind("qpos"),
            **{f"state_{name}": self._batch.bind(name) for name in _STATE},
            **{f"samples_{name}": samples.rows for name, samples in self._kept.items()},
            **{f"yaw_{name}": values for name, values in self._leg_yaw.state().items()},
            **{f"scan_{name}": values for name, values in self._scanner.state().items()},
            "seen": np.array(self._seen).reshape(-1, 2, len(self._robots)),
        }

    def restore(self, settings: dict[str, Any], arrays: dict[str, Any]) -> None:
        super().restore(settings, arrays)
        self._tick = operator.index(settings["tick"])
        self._mark(slice(None), [Status[name] for name in settings["status"]])
        for name in _STATE:
            self._batch.bind(name)[:] = arrays[f"state_{name}"]
        for name, samples in self._kept.items():
            rows = arrays[f"samples_{name}"]
            samples.grown(len(rows))[:] = rows
        self._leg_yaw.restore(part(arrays, "yaw_"))
        self._seen = list(arrays["seen"])
        self._scanner.restore(part(arrays, "scan_"))
        self._put_poles()

    def to_dataset(self, copy: bool = True) -> xr.Dataset:
        """Record so far, see :func:`chilopod.twin.simulate`; without a copy if the walk ends here."""
        plan, count = self._plan, 0 if self._record is None else len(self._record.samples(self._time))
        positions, rates = (self._kept[name].grown(0)[:count] for name in ("qpos", "qvel"))
        positions, rates = (each.copy() if copy else each for each in (positions, rates))
        turn = rotation(positions[..., 3:7])
        times = np.asarray(self._sampling.steps(np.arange(len(positions))) * plan.twin.timestep, dtype=np.float64)
        data = walk_record(
            times,
            position=positions[..., :2],
            heading=np.unwrap(_heading(turn), axis=0),
            velocity=rates[..., :2],
            # MuJoCo gives the angular velocity of the free joint in the frame of the body.
            heading_rate=np.einsum("...j,...j->...", turn[..., 2, :], rates[..., 3:6]),
            joint_angle=positions[..., plan.yaw_positions],
            joint_rate=rates[..., plan.yaw_rates],
            leg_yaw=positions[..., plan.leg_yaw_positions],
        )
        found = {}
        if self._seen and self._targets.recorded(times) is not None:
            seen = np.array(self._seen)
            found["seen_bearing"] = quantity("seen_bearing", seen[:, 0])
            found["seen_distance"] = quantity("seen_distance", seen[:, 1])
        if self._record and self._record.forces:
            known = self._kept["sensordata"].rows[:count]
            forces = np.full((count, *known.shape[1:]), np.nan)  # at time 0 they are those of a step that is to come
            forces[: len(known)] = known
            # The sensor gives the force of the foot on the floor.
            forces = -forces.reshape(*forces.shape[:2], plan.robot.body.modules, len(SIDES), 3)
            data.coords["module"] = np.arange(1, plan.robot.body.modules + 1)
            found["foot_force"] = quantity("foot_force", forces[..., :2])
            found["foot_load"] = quantity("foot_load", forces[..., 2])
        if self._record and self._record.poses:
            found["pose"] = quantity("pose", positions)
        self._finish(data, times, found)
        return data

    # -- inside

    def _put(self, ids: NDArray[np.intp], states: Array) -> None:
        """Set the states of robots; at rest, if states have no velocities."""
        coordinates = self._plan.model.nq
        self._batch.bind("qpos")[ids] = states[:, :coordinates]
        self._batch.bind("qvel")[ids] = states[:, coordinates:] if states.shape[1] > coordinates else 0.0

    def _rub(self) -> None:
        """Set the friction of the feet."""
        plan = self._plan
        self._batch.expand("geom_friction")[:, plan.feet, 0] = plan.twin.sliding_friction * self._factors

    def _mark(self, which: Any, status: Any) -> None:
        """Set the status of some robots."""
        self._status[which] = status
        self._gone[:] = self._status != Status.WALKED

    @property
    def _walking(self) -> NDArray[np.intp]:
        return np.flatnonzero(~self._gone)

    def _look(self) -> Array:
        """Bearing and distance of the target in the last scan, shape (2, robots); NaN for robots that no longer
        walk."""
        seen = np.full((2, len(self._robots)), np.nan)
        looking = np.flatnonzero(self._targets.there & ~self._gone)
        if len(looking):
            seen[:, looking] = self._scanner.look(looking)
        return seen

    def _put_poles(self) -> None:
        """Move the poles to the targets."""
        there, poles = self._targets.there, self._batch.bind("mocap_pos")
        poles[:, 0] = AWAY
        poles[there, 0, :2], poles[there, 0, 2] = self._targets.present[there], 0.0
        self._scanner.forget()

    def _step_to(self, tick: int) -> None:
        plan, batch, walking = self._plan, self._batch, self._walking
        per_tick = plan.steps_per_control
        first, count = self._tick * per_tick, (tick - self._tick) * per_tick
        kept = self._kept
        before = batch.bind("qpos")[walking], batch.bind("qvel")[walking]
        out = batch.rollout(count, self._controls(tick), record=list(kept), ids=walking)
        self._scanner.passed(self._tick, tick, out["qpos"][:, per_tick - 1 :: per_tick, :7], walking)
        samples = np.arange(self._sampling.count(first), self._sampling.count(first + count))
        at = self._sampling.steps(samples) - first - 1
        for name, store in kept.items():
            if samples.size:
                store.grown(samples[-1] + 1)[samples[0] :, walking] = np.swapaxes(out[name][:, at], 0, 1)
        if self._tick == 0 and "sensordata" in kept:  # forces are of the step before, at time 0 of the step after
            start = self._sampling.count(0)
            kept["sensordata"].grown(start)[:start, walking] = out["sensordata"][:, 0]
        warned = batch.warning[walking].any(axis=tuple(range(1, batch.warning.ndim)))
        found = failures(out["qpos"], out["qvel"], before, plan.yaw_positions, warned)
        for row, (step, status) in found.items():
            self._mark(walking[row], status)
            for store in kept.values():
                store.grown(0)[samples[at >= step], walking[row]] = np.nan
        if found:
            # The later states of a failed robot depend on the division of time, so it is reset.
            ended = walking[list(found)]
            batch.reset(ended, stage=mujoco.mjtStage.mjSTAGE_NONE)
            self._scanner.restart(ended, anew=False)
            self._put_poles()

    def _controls(self, tick: int) -> Array:
        """Controls of all actuators before every step up to a tick, for walking robots, shape (robots, steps, nu)."""
        plan, ticks, per_tick = self._plan, np.arange(self._tick, tick), self._plan.steps_per_control
        control = np.zeros((len(self._walking), len(ticks), plan.model.nu))
        # Both legs at the knees and hips, then the yaw of module 1's.
        control[..., plan.leg_controls.ravel()] = self._leg_targets(ticks)
        leg_yaw = np.swapaxes(self._leg_yaw.at(ticks.astype(np.float64)), 0, 1)
        control[..., plan.leg_yaw_controls] = leg_yaw[self._walking]
        control = np.repeat(control, per_tick, axis=1)
        if self._actuators.driven.any() and len(plan.spring_controls):
            edges = np.arange(self._tick * per_tick, tick * per_tick + 1) * plan.twin.timestep
            change = self._actuators.mean_stiffness(np.asarray(edges, dtype=np.float64)) - self._springs
            # Robots without commands walk to the same bits whatever the others of the batch are commanded.
            change[:, ~self._actuators.driven] = 0.0
            control[..., plan.spring_controls] = np.swapaxes(change, 0, 1)[self._walking]
        return control

    def _leg_targets(self, ticks: NDArray[np.intp]) -> Array:
        """Servo targets of all hips and knees, shape (ticks, legs times 2)."""
        if ticks[-1] >= self._servos_from + len(self._servos):
            self._servos_from = int(ticks[0])
            self._servos = _targets(self._plan.robot, self._servos_from, max(len(ticks), _TARGETS_AHEAD))
        return self._servos[ticks - self._servos_from]


def state_size(plan: TwinModel, initial: ArrayLike | None) -> int:
    """Length of a state: MuJoCo's ``qpos``, followed by ``qvel`` if given."""
    both = plan.model.nq + plan.model.nv
    return both if initial is not None and as_array("initial", initial).shape[-1:] == (both,) else plan.model.nq


@lru_cache(maxsize=32)
def _targets(robot: Robot, first: int, count: int) -> Array:
    """Servo targets of all hips and knees from a tick on, (count, legs times 2), read-only."""
    targets = servo_targets(robot, np.arange(first, first + count) * twin_of(robot).control_interval)
    return read_only(targets.reshape(count, -1))


def _heading(turn: Array) -> Array:
    """Heading of rotation matrices (..., 3, 3), rad."""
    return np.asarray(np.arctan2(turn[..., 1, 0], turn[..., 0, 0]))
