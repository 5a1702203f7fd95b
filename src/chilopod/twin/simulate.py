"""Walks of many robots at a time in three dimensions, straight on or steered, as a record over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby
from operator import itemgetter

import numpy as np
import xarray as xr
from mujoco.batch import Batch
from numpy.typing import ArrayLike, NDArray

from chilopod.engine import Controller, Event, Observation, Status, event_times
from chilopod.record import RATE, add_outcome, walk_record
from chilopod.robot import Robot
from chilopod.twin.legs import servo_targets
from chilopod.twin.model import SIDES, silence
from chilopod.twin.plan import Plan, checked_plan
from chilopod.twin.scanner import beams, detect, rotation, scan

Array = NDArray[np.float64]

TOLERANCE = 1e-8
"""Default of the contact solver, MuJoCo's own."""

_FASTEST = 100.0  # m/s and rad/s: a robot that moves faster than that has blown up
_FARTHEST = 1e6  # m and rad, likewise
_UPRIGHT = 0.5  # cosine of the tilt of module 1 beyond which it has fallen over
_LONGEST_STRETCH = 0.6  # s that are stepped without a look, and kept step by step meanwhile
_TARGETS_AHEAD = 2048  # ticks for which servo targets are computed at a time


def simulate(
    robots: Robot | Sequence[Robot],
    duration: float,
    *,
    initial: ArrayLike | None = None,
    friction: ArrayLike | None = None,
    controller: Controller | None = None,
    target: ArrayLike | None = None,
    scan_seeds: Sequence[int] | None = None,
    rate: float = RATE,
    forces: bool = False,
    poses: bool = False,
    threads: int = 0,
    tolerance: float = TOLERANCE,
    progress: Callable[[float, str], None] = lambda done, words: None,
) -> xr.Dataset:
    """Let robots walk on the floor; each one alone, all of them at the same time.

    Parameters
    ----------
    robots
        One, or one for every walk; they may differ in the stiffness and damping of their springs and in nothing else.
    duration
        s; the gait is at phase 0 at time 0.
    initial
        From :func:`initial_states`, shape (walks, nq) or (nq,); by default straight from the origin along x.
    friction
        Factor on the friction coefficient of every foot, positive, shape (N, 2) or (walks, N, 2).
    controller
        Asked for leg yaw at its events, at the first servo target from then on.
    target
        Place of the pole on the floor, m, shape (2,) or (walks, 2). The controller sees what the scanner made of its
        last scan.
    scan_seeds
        Of the scanner's noise, one a walk; without them it has none.
    rate
        Samples per second; they are taken at the nearest step.
    forces
        Whether to add the force on every foot.
    poses
        Whether to add the positions of all joints, from which the robot can be drawn.
    threads
        At most; 0 for all cores. Results are the same to the bit at any number.
    tolerance
        At which MuJoCo's solver of contact forces stops, relative.
    progress
        Called with the part done (0 to 1) and a few words.

    Returns
    -------
    Dataset as that of :func:`chilopod.planar.simulate`, with ``leg_yaw`` as the joints are, not as they should be; with
    a target and a controller also ``seen_bearing`` and ``seen_distance`` over (event, robot), what the controller saw,
    NaN where the pole was out of view; with ``poses``, ``pose`` over (time, robot, coordinate).

    Raises
    ------
    ParameterError
        If an argument has the wrong shape or is out of range, or the robots do not go together.
    """
    plan = checked_plan(robots, duration, initial, friction, target, scan_seeds, rate, forces)
    walk = _Walk(plan, controller, duration, rate, forces, threads)
    walk.batch.expand("opt.tolerance")[:] = tolerance
    with silence():
        for tick in walk.cuts[1:]:
            walk.step_to(tick)
            progress(tick / walk.cuts[-1], f"{tick * plan.model.twin.control_interval:.1f} s")
    return walk.record(poses)


class _Walk:
    """Robots under way, and what has been recorded of them so far; time is counted in servo targets (ticks)."""

    def __init__(
        self, plan: Plan, controller: Controller | None, duration: float, rate: float, forces: bool, threads: int
    ) -> None:
        self.plan, self.controller = plan, controller
        robot, model, twin = plan.model.robot, plan.model.model, plan.model.twin
        self.count, self.tick = len(plan.robots), 0
        self.ticks = max(1, round(duration / twin.control_interval))
        self.batch = Batch(model, self.count, threads)
        stiffness, damping = self.batch.expand("jnt_stiffness"), self.batch.expand("dof_damping")
        stiffness[:, plan.model.yaw_joints] = [each.springs.stiffness for each in plan.robots]
        damping[:, plan.model.yaw_rates] = [each.springs.damping for each in plan.robots]
        self.batch.expand("geom_friction")[:, plan.model.feet, 0] = twin.sliding_friction * plan.friction
        self.batch.bind("qpos")[:] = plan.states
        if plan.target is not None:
            self.batch.bind("mocap_pos")[:, 0, :2] = plan.target
            self.batch.bind("mocap_pos")[:, 0, 2] = 0.0

        asked = event_times(controller, robot.gait, duration) if controller else []
        ticks = [int(np.ceil(t / twin.control_interval - 1e-9)) for t, _ in asked]
        # Several events may fall on one tick: those of both legs, in a gait that has them in phase.
        pairs = [(tick, each) for tick, each in zip(ticks, asked, strict=True) if tick < self.ticks]
        self.events = [each for _, each in pairs]
        self.asked = {tick: [each for _, each in group] for tick, group in groupby(pairs, key=itemgetter(0))}
        self.scans = self._scans(list(self.asked)) if plan.target is not None else {}
        longest = max(1, int(_LONGEST_STRETCH / twin.control_interval))
        needed = sorted({0, self.ticks, *self.asked, *self.scans})
        self.cuts = [tick for a, b in zip(needed, needed[1:], strict=False) for tick in range(a, b, longest)]
        self.cuts.append(self.ticks)

        per_tick = plan.model.steps_per_control
        samples = np.arange(int(np.floor(duration * rate * (1.0 + 1e-12))) + 1) / rate
        self.sample_steps = np.minimum(np.round(samples / twin.timestep).astype(int), self.ticks * per_tick)
        shape = (len(samples), self.count)
        self.positions = np.full((*shape, model.nq), np.nan)
        self.rates = np.full((*shape, model.nv), np.nan)
        at_start = self.sample_steps == 0  # several, if sampled more often than stepped
        self.positions[at_start], self.rates[at_start] = plan.states, 0.0
        self.forces = np.full((*shape, model.nsensordata), np.nan) if forces else None
        self.status = [Status.WALKED] * self.count
        self.walking = np.arange(self.count)
        self.yaw, self.yaw_reached = np.zeros((2, self.count, 2))
        self.ramps: list[tuple[int, int, Array]] = []
        self.targets_from, self.targets = 0, np.empty((0, plan.model.leg_controls.size))
        self.seen = np.full((2, self.count), np.nan)
        self.answers: list[tuple[Array, float, Array]] = []

    def _scans(self, ticks: Sequence[int]) -> dict[int, int]:
        """The scans that a controller gets to see, the last one before each event: number of the scan by tick."""
        twin = self.plan.model.twin
        every = twin.scanner_period / twin.control_interval
        numbers = sorted({int(tick / every + 1e-9) for tick in ticks})
        return {round(number * every): number for number in numbers}

    def step_to(self, tick: int) -> None:
        """Look and ask, if it is time to, then walk on."""
        if self.tick in self.scans:
            self._look(self.scans[self.tick])
        for t, event in self.asked.get(self.tick, ()):
            self._ask(t, event)
        if len(self.walking):
            self._walk(tick)
        self.tick = tick

    def _look(self, number: int) -> None:
        twin, seeds = self.plan.model.twin, self.plan.scan_seeds
        noise = None
        if seeds is not None:
            size = len(beams(twin))
            noise = np.stack([np.random.default_rng([seeds[i], number]).standard_normal(size) for i in self.walking])
        self.seen[:] = np.nan
        if len(self.walking):
            scans = scan(twin, self.batch, self.walking, noise)
            self.seen[:, self.walking] = np.transpose([detect(twin, each) for each in scans])

    def _ask(self, t: float, event: Event) -> None:
        assert self.controller is not None
        seen = self.seen.copy()
        angles = self.batch.bind("qpos")[:, self.plan.model.yaw_positions].copy()
        command = self.controller.act(event, Observation(t, seen[0], seen[1], angles, self.yaw.copy()))
        walking = np.isin(np.arange(self.count), self.walking)[:, None]
        before, self.yaw = self.yaw, np.where(walking, command.leg_yaw, self.yaw)
        ramp = max(1, round(command.within / self.plan.model.twin.control_interval))
        self.ramps.append((self.tick, ramp, self.yaw - before))
        self.answers.append((self.yaw, command.within, seen))

    def _walk(self, tick: int) -> None:
        plan, per_tick, ticks = self.plan.model, self.plan.model.steps_per_control, np.arange(self.tick, tick)
        # Both legs at the knees and hips, then the yaw of module 1's.
        control = np.zeros((len(self.walking), len(ticks), plan.model.nu))
        control[..., plan.leg_controls.ravel()] = self._leg_targets(ticks)
        if self.controller is not None:
            control[..., plan.leg_yaw_controls] = self._yaw_targets(ticks)[self.walking]
        record = ["qpos", "qvel"] + (["sensordata"] if self.forces is not None else [])
        out = self.batch.rollout(
            len(ticks) * per_tick, np.repeat(control, per_tick, axis=1), record=record, ids=self.walking
        )
        step = self.sample_steps - self.tick * per_tick
        here = np.flatnonzero((step > 0) & (step <= len(ticks) * per_tick))
        at = step[here] - 1
        kept = [self.positions, self.rates] + ([self.forces] if self.forces is not None else [])
        for name, array in zip(record, kept, strict=True):
            array[np.ix_(here, self.walking)] = np.swapaxes(out[name][:, at], 0, 1)
        if self.forces is not None and self.tick == 0:  # forces are of the step before, at time 0 of the step after
            self.forces[np.ix_(step == 0, self.walking)] = out["sensordata"][:, 0]
        self._find_failures(out["qpos"], out["qvel"], here, at)

    def _leg_targets(self, ticks: NDArray[np.intp]) -> Array:
        """Servo targets of all hips and knees, shape (ticks, legs times 2)."""
        if ticks[-1] >= self.targets_from + len(self.targets):
            self.targets_from = int(ticks[0])
            ahead = np.arange(ticks[0], max(ticks[-1] + 1, min(ticks[0] + _TARGETS_AHEAD, self.ticks)))
            targets = servo_targets(self.plan.model.robot, ahead * self.plan.model.twin.control_interval)
            self.targets = targets.reshape(len(ahead), -1)
        return self.targets[ticks - self.targets_from]

    def _yaw_targets(self, ticks: NDArray[np.intp]) -> Array:
        """Leg yaw asked for at every tick, shape (robots, ticks, 2); ramps end before the legs' next events."""
        while self.ramps and self.ramps[0][0] + self.ramps[0][1] <= ticks[0]:
            self.yaw_reached = self.yaw_reached + self.ramps.pop(0)[2]
        yaw = np.repeat(self.yaw_reached[:, None], len(ticks), axis=1)
        for start, length, change in self.ramps:
            part = np.clip((ticks - start) / length, 0.0, 1.0)[None, :, None]
            yaw += part * change[:, None, :]
        return yaw

    def _find_failures(self, positions: Array, rates: Array, here: NDArray[np.intp], at: NDArray[np.intp]) -> None:
        """Give robots that no longer walk their status, and blank their records from then on."""
        # MuJoCo stops a simulation that it warns of and repeats its last state.
        warned = self.batch.warning.any(axis=tuple(range(1, self.batch.warning.ndim)))
        bends = positions[..., self.plan.model.yaw_positions]
        with np.errstate(invalid="ignore", over="ignore"):
            # Cosine of the tilt, from the quaternion.
            upright = 1.0 - 2.0 * (positions[..., 4] ** 2 + positions[..., 5] ** 2)
            most = (np.abs(rates).max(), np.abs(positions).max(), np.abs(bends).max(), -upright.min())
            if not warned.any() and np.less(most, (_FASTEST, _FARTHEST, 0.5 * np.pi, -_UPRIGHT)).all():
                return  # as nearly always, and that takes no time
            quiet = (np.abs(rates).max(2) < _FASTEST) & (np.abs(positions).max(2) < _FARTHEST)
            straight, standing = np.abs(bends).max(2) <= 0.5 * np.pi, upright > _UPRIGHT
        for row, robot in enumerate(self.walking):
            signs = ((quiet, Status.DIVERGED), (straight, Status.OUT_OF_RANGE), (standing, Status.FALLEN))
            bad = [(int(np.argmin(good[row])), status) for good, status in signs if not good[row].all()]
            if not bad and not warned[robot]:
                continue
            failed, self.status[robot] = bad[0] if bad else (0, Status.DIVERGED)
            lost = here[at >= failed]
            for array in (self.positions, self.rates, self.forces):
                if array is not None:
                    array[lost, robot] = np.nan
        self.walking = np.array([i for i in self.walking if self.status[i] is Status.WALKED], dtype=int)

    def record(self, poses: bool) -> xr.Dataset:
        """What has been recorded, under the names that every engine gives it."""
        plan, twin, positions, rates = self.plan.model, self.plan.model.twin, self.positions, self.rates
        turn = rotation(positions[..., 3:7])
        data = walk_record(
            self.sample_steps * twin.timestep,
            position=positions[..., :2],
            heading=np.unwrap(np.arctan2(turn[..., 1, 0], turn[..., 0, 0]), axis=0),
            velocity=rates[..., :2],
            # Of the free joint, MuJoCo gives the rate of turn in the frame of the body.
            heading_rate=np.einsum("...j,...j->...", turn[..., 2, :], rates[..., 3:6]),
            joint_angle=positions[..., plan.yaw_positions],
            joint_rate=rates[..., plan.yaw_rates],
            leg_yaw=positions[..., plan.leg_yaw_positions],
        )
        commands = np.array([yaw for yaw, _, _ in self.answers]).reshape(-1, self.count, 2)
        within = np.array([each for _, each, _ in self.answers])
        asked = self.events if self.controller else None
        add_outcome(data, self.status, self.plan.target, asked, commands, within)
        if self.controller and self.plan.target is not None:
            seen = np.array([each for _, _, each in self.answers]).reshape(-1, 2, self.count)
            data["seen_bearing"] = (("event", "robot"), seen[:, 0], {"units": "rad"})
            data["seen_distance"] = (("event", "robot"), seen[:, 1], {"units": "m"})
        if self.forces is not None:
            shape = (*self.forces.shape[:2], plan.robot.body.modules, len(SIDES), 3)
            data.coords["module"] = np.arange(1, plan.robot.body.modules + 1)
            over = ("time", "robot", "module", "side")
            # The sensor gives what the foot does to the floor.
            data["foot_force"] = ((*over, "axis"), -self.forces.reshape(shape)[..., :2], {"units": "N"})
            data["foot_load"] = (over, -self.forces.reshape(shape)[..., 2], {"units": "N"})
        if poses:
            data["pose"] = (("time", "robot", "coordinate"), positions, {"units": "m, 1, rad: MuJoCo's qpos"})
        data.attrs = {"engine": "twin", "robot": plan.robot.to_toml(), "duration": self.ticks * twin.control_interval}
        return data
