"""Walks of many robots at a time in three dimensions, straight on or steered, as a record over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from mujoco.batch import Batch
from numpy.typing import ArrayLike, NDArray

from chilopod.engine import Controller, Event, Observation, Status, event_times
from chilopod.errors import ParameterError
from chilopod.record import MOST_NUMBERS, add_outcome, walk_record
from chilopod.robot import Robot
from chilopod.twin.legs import servo_targets
from chilopod.twin.model import SIDES, TwinModel, compiled
from chilopod.twin.scanner import beams, detect, rotation, scan

Array = NDArray[np.float64]

RATE = 100.0
"""Default sampling rate of records, Hz."""

LONGEST = 1e5
"""s, more than a day: anything longer is a slip of the pen."""

_FASTEST = 100.0  # m/s and rad/s: a robot that moves faster than that has blown up
_FARTHEST = 1e6  # m and rad, likewise
_UPRIGHT = 0.5  # cosine of the tilt of module 1 beyond which it has fallen over
_LONGEST_STRETCH = 0.6  # s that are stepped without a look, and kept step by step meanwhile


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
    plan = _plan(robots, duration, initial, friction, target, scan_seeds, rate, forces)
    walk = _Walk(plan, controller, duration, rate, forces, threads)
    for tick in walk.cuts[1:]:
        walk.step_to(tick)
        progress(tick / walk.cuts[-1], f"{tick * plan.model.twin.control_interval:.1f} s")
    return walk.record(poses)


@dataclass(frozen=True)
class _Plan:
    """Checked arguments, one row a walk."""

    model: TwinModel
    robots: list[Robot]
    states: Array
    friction: Array
    target: Array | None
    scan_seeds: list[int] | None


class _Walk:
    """Robots under way, and what has been recorded of them so far; time is counted in servo targets (ticks)."""

    def __init__(
        self, plan: _Plan, controller: Controller | None, duration: float, rate: float, forces: bool, threads: int
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
        self.asked = {tick: (t, event) for tick, (t, event) in zip(ticks, asked, strict=True) if tick < self.ticks}
        self.events = list(self.asked.values())
        self.scans = self._scans(ticks) if plan.target is not None else {}
        longest = max(1, int(_LONGEST_STRETCH / twin.control_interval))
        cuts = sorted({*range(0, self.ticks, longest), self.ticks, *self.asked, *self.scans})
        self.cuts = [tick for tick in cuts if tick <= self.ticks]

        per_tick = plan.model.steps_per_control
        samples = np.arange(int(np.floor(duration * rate * (1.0 + 1e-12))) + 1) / rate
        self.sample_steps = np.minimum(np.round(samples / twin.timestep).astype(int), self.ticks * per_tick)
        shape = (len(samples), self.count)
        self.positions = np.full((*shape, model.nq), np.nan)
        self.rates = np.full((*shape, model.nv), np.nan)
        self.positions[0], self.rates[0] = plan.states, 0.0
        self.forces = np.full((*shape, model.nsensordata), np.nan) if forces else None
        self.status = [Status.WALKED] * self.count
        self.walking = np.arange(self.count)
        self.yaw = np.zeros((self.count, 2))
        self.ramps = [(0, 1, np.zeros((self.count, 2)), self.yaw)]
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
        if self.tick in self.asked:
            self._ask(*self.asked[self.tick])
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
        self.ramps.append((self.tick, ramp, before, self.yaw))
        self.answers.append((self.yaw, command.within, seen))

    def _walk(self, tick: int) -> None:
        plan, per_tick = self.plan.model, self.plan.model.steps_per_control
        ticks = np.arange(self.tick, tick)
        # Both legs at the knees and hips, then the yaw of module 1's.
        control = np.zeros((len(self.walking), len(ticks), plan.model.nu))
        targets = servo_targets(plan.robot, ticks * plan.twin.control_interval)
        control[..., plan.leg_controls.ravel()] = targets.reshape(len(ticks), -1)
        control[..., plan.leg_yaw_controls] = self._yaw_targets(ticks)[self.walking]
        record = ["qpos", "qvel"] + (["sensordata"] if self.forces is not None else [])
        out = self.batch.rollout(
            len(ticks) * per_tick, np.repeat(control, per_tick, axis=1), record=record, ids=self.walking
        )
        first = self.tick * per_tick
        here = np.flatnonzero((self.sample_steps > first) & (self.sample_steps <= tick * per_tick))
        at = self.sample_steps[here] - first - 1
        kept = [self.positions, self.rates] + ([self.forces] if self.forces is not None else [])
        for name, array in zip(record, kept, strict=True):
            array[np.ix_(here, self.walking)] = np.swapaxes(out[name][:, at], 0, 1)
        self._find_failures(out["qpos"], out["qvel"], here, at)

    def _yaw_targets(self, ticks: NDArray[np.intp]) -> Array:
        """Leg yaw asked for at every tick, shape (robots, ticks, 2); ramps end before the legs' next events."""
        yaw = np.zeros((self.count, len(ticks), 2))
        for start, length, before, after in self.ramps:
            part = np.clip((ticks - start) / length, 0.0, 1.0)[None, :, None]
            yaw += part * (after - before)[:, None, :]
        return yaw

    def _find_failures(self, positions: Array, rates: Array, here: NDArray[np.intp], at: NDArray[np.intp]) -> None:
        """Give robots that no longer walk their status, and blank their records from then on."""
        with np.errstate(invalid="ignore"):
            quiet = (np.abs(rates).max(2) < _FASTEST) & (np.abs(positions).max(2) < _FARTHEST)
            upright = rotation(positions[..., 3:7])[..., 2, 2] > _UPRIGHT
            straight = np.abs(positions[..., self.plan.model.yaw_positions]).max(2) <= 0.5 * np.pi
        # MuJoCo stops a simulation that it warns of and repeats its last state.
        warned = self.batch.warning.sum(axis=tuple(range(1, self.batch.warning.ndim))) > 0
        for row, robot in enumerate(self.walking):
            for good, status in ((quiet, Status.DIVERGED), (straight, Status.OUT_OF_RANGE), (upright, Status.FALLEN)):
                if not np.all(good[row]):
                    self.status[robot] = status
                    failed = int(np.argmin(good[row]))
                    break
            else:
                if not warned[robot]:
                    continue
                self.status[robot], failed = Status.DIVERGED, 0
            lost = here[at >= failed]
            for array in (self.positions, self.rates, self.forces):
                if array is not None:
                    array[lost, robot] = np.nan
        self.walking = np.array([i for i in self.walking if self.status[i] is Status.WALKED], dtype=int)

    def record(self, poses: bool) -> xr.Dataset:
        """What has been recorded, under the names that every engine gives it."""
        plan, twin = self.plan.model, self.plan.model.twin
        positions, rates = self.positions, self.rates
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


def _plan(
    robots: Robot | Sequence[Robot],
    duration: float,
    initial: ArrayLike | None,
    friction: ArrayLike | None,
    target: ArrayLike | None,
    scan_seeds: Sequence[int] | None,
    rate: float,
    forces: bool,
) -> _Plan:
    for name, value, most in (("duration", duration, LONGEST), ("rate", rate, 1e6)):
        if not 0.0 < value <= most:
            raise ParameterError("is out of range", field=name, value=value, allowed=f"more than 0, at most {most:g}")
    given = [robots] if isinstance(robots, Robot) else list(robots)
    if not given:
        raise ParameterError("there are none", field="robots", allowed="at least one")
    first = given[0]
    if any(_without_springs(each) != _without_springs(first) for each in given):
        raise ParameterError("may differ in their springs only", field="robots")
    model = compiled(_without_springs(first), forces)
    shapes = {"initial": (model.model.nq,), "friction": (first.body.modules, 2), "target": (2,)}
    rows: dict[str, Array] = {}
    counts = {len(given), 1 if scan_seeds is None else len(scan_seeds)}
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

    return _Plan(
        model,
        given * (count if len(given) == 1 else 1),
        spread("initial", initial_states(first)[0]),
        spread("friction", np.ones(shapes["friction"])),
        spread("target", np.zeros(2)) if target is not None else None,
        None if scan_seeds is None else list(scan_seeds) * (count if len(scan_seeds) == 1 else 1),
    )


def _without_springs(robot: Robot) -> Robot:
    """The robot as far as the model is concerned that a batch shares."""
    joints = robot.body.modules - 1
    same = robot.springs.model_copy(update={"stiffness": (1.0,) * joints, "damping": (0.0,) * joints})
    return robot.model_copy(update={"name": "robot", "springs": same, "provenance": type(robot.provenance)()})
