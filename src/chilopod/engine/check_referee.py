"""Checks of the promises of the contract to referees, which set tasks and do not steer."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from chilopod.engine.check_trial import END, Trial, expect, expect_near, expect_refused, expect_same
from chilopod.engine.contract import Command, Observation, Status, Walk
from chilopod.record import Recording

BREAKS = 0.6
"""Time of the event in the middle of the walks, s."""

_STOPS = 0.98  # s: on a sample, on no command
_NEAR = 1e-4  # rad and m, after two gait cycles, of states that agree to the tolerance of an integrator or solver


def places(trial: Trial) -> None:
    """Check that poses agree with the record."""
    walk = trial.start(target=None)
    start = np.tile([0.2, -0.1, 0.3], (len(trial.robots), 1))
    expect_near(walk.pose(), start, 1e-6, "pose at the start, m and rad")
    looked, silent = trial.walked(walk), trial.walked(trial.start(target=None))
    walk.pose()[:] = 123.0
    last = np.column_stack([looked.position.values[-1], looked.heading.values[-1]])
    pose = walk.pose()
    expect_near(pose[:, :2], last[:, :2], 0.02, "pose at the end and the record, m")
    expect_near(np.cos(pose[:, 2] - last[:, 2]), np.ones(len(pose)), 1e-3, "heading of pose at the end and the record")
    expect_same(silent, looked, "with and without a look at the pose")


def aims(trial: Trial) -> None:
    """Check targets that are moved, removed and set."""
    here, there, nowhere = np.array([0.9, 0.4]), np.array([0.8, -0.5]), np.full(2, np.nan)
    where = np.stack([there, nowhere, here])

    def aimed(walk: Walk) -> Walk:
        expect(np.isnan(walk.observe().bearing).all(), "the bearing is finite without a target")
        wrong: Any = (here[:1], np.full((len(where) + 1, 2), 1.0), here * np.inf, [np.nan, 1.0], "there", None)
        for target in wrong:
            expect_refused(f"the target {target}", partial(walk.aim, target))
        walk.aim(here)
        before = walk.observe()
        walk.aim(where)
        walk = trial.engine.resume(walk.save())
        seen, pose = walk.observe(), walk.pose()
        away = where - pose[:, :2]
        bearing = np.arctan2(away[:, 1], away[:, 0]) - pose[:, 2]
        # The last look of a scanner is older than the observation.
        expect_near(seen.distance, np.hypot(away[:, 0], away[:, 1]), 0.03, "distance of a target that was moved, m")
        expect_near(seen.bearing, bearing, 0.05, "bearing of a target that was moved, rad")
        expect_near(seen.distance[2:], before.distance[2:], 0.0, "distance of a target that stayed, m")
        return walk

    still = trial.walked(trial.start())
    expect("target" not in trial.walked(trial.start(target=None)), "the record of a walk without a target has one")
    data = trial.led(trial.start(target=None), {BREAKS: aimed}).to_dataset()
    over = ("time", "robot", "axis")
    expect("target" in data, "the record has no target")
    expect(data.target.dims == over, f"target has dimensions {data.target.dims}, not {over}")
    count = int((data.time.values <= BREAKS).sum())
    moved = np.concatenate([np.full((count, *where.shape), np.nan), np.tile(where, (data.sizes["time"] - count, 1, 1))])
    expect_near(data.target.values, moved, 0.0, "target over time, m")
    away = moved - data.position.values
    expect_near(data.distance.values, np.hypot(away[..., 0], away[..., 1]), 1e-9, "distance over time, m")
    for name in ("position", "heading", "joint_angle", "stiffness"):
        expect(data[name].equals(still[name]), f"{name} changes when the target is moved")


def halts(trial: Trial) -> None:
    """Check a halt of one robot of three, then of all."""

    def halted(walk: Walk) -> Walk:
        wrong: Any = ([1], np.ones(len(trial.robots)), np.ones(len(trial.robots) + 1, dtype=bool), None)
        for which in wrong:
            expect_refused(f"halting {which}", partial(walk.halt, which))
        walk.halt(np.array([False, True, False]))
        before.append(walk.observe())
        return trial.engine.resume(walk.save())

    before: list[Observation] = []
    free, walk = trial.walked(trial.start()), trial.led(trial.start(), {_STOPS: halted})
    expect(walk.status == (Status.WALKED, Status.HALTED, Status.WALKED), f"status is {walk.status}")
    seen = walk.observe()
    for what, array in (("bearing", seen.bearing), ("joint_angles", seen.joint_angles), ("pose", walk.pose())):
        expect(np.isnan(array[1]).all(), f"a robot that was halted has {what}")
    expect(np.array_equal(seen.leg_yaw[1], before[0].leg_yaw[1]), "a robot that was halted obeys")
    data = walk.to_dataset()
    last = round(_STOPS * 50.0)
    for name in ("position", "heading", "joint_angle", "distance"):
        found, wanted = data[name].values, free[name].values
        expect(np.array_equal(found[:last, 1], wanted[:last, 1]), f"{name} of a halted robot changes before the halt")
        # At the time of the move, or within its step, either target is valid.
        expect(np.isnan(found[last + 2 :, 1]).all(), f"{name} is finite after the halt")
        for i in (0, 2):
            expect(np.array_equal(found[:, i], wanted[:, i]), f"{name} of robot {i} changes when robot 1 is halted")
    walk.halt(np.ones(len(trial.robots), dtype=bool))
    walk.advance(END + 0.1)
    expect(set(walk.status) == {Status.HALTED}, "robots walk on that were halted")
    expect(np.isnan(walk.to_dataset().heading.values[-1]).all(), "halted robots have finite records")


def states(trial: Trial) -> None:
    """Check that ``start`` accepts the states of a walk."""
    walk, period = trial.start(seeds=None), trial.robot.gait.period
    walk.advance(period)
    walk.halt(np.array([False, True, False]))
    now = walk.states()
    expect(len(now) == len(trial.robots) and now.ndim == 2, f"states have shape {now.shape}")
    expect(np.isnan(now[1]).all() and np.isfinite(now[[0, 2]]).all(), "states must be NaN for halted robots only")
    again = trial.engine.start(trial.robots[2], initial=now[2], target=(0.9, 0.4), record=None)
    expect(again.time == 0.0 and again.states().shape == (1, now.shape[1]), "states of the new walk have a wrong shape")
    for ahead in (0.0, 2.0 * period):
        walk.advance(period + ahead)
        again.advance(ahead)
        _expect_alike(walk, 2, again, "of a walk and of another from its states")
    now[:] = 123.0
    expect(not (walk.states()[[0, 2]] == 123.0).any(), "writing into states changes the walk")


def restarts(trial: Trial) -> None:
    """Check a restart of one robot of three that walk, after it was halted."""
    free, walk = (trial.start(seeds=None, record=None) for _ in range(2))
    period, one, none = trial.robot.gait.period, np.array([False, True, False]), np.zeros(3, dtype=bool)
    begin = trial.engine.initial_states(trial.robot, -trial.bends[1], 1.0, (0.5, 0.2))
    firm, commands = np.full((trial.robot.body.modules, 2), 1.2), trial.commands()
    for number, command in enumerate(commands):
        for each in (free, walk):
            each.advance((number + 0.4) * period)
            each.command(command)
    expect_refused("a restart in the middle of a gait cycle", partial(walk.restart, one, begin))
    recorded = trial.start(record=Recording(rate=50.0))
    expect_refused("a restart of a walk with a record", partial(recorded.restart, one, begin))
    for each in (free, walk):
        each.advance(len(commands) * period)
    walk.halt(one)
    wrong: Any = (([1], begin), (one, begin[:, :-1]), (one, np.nan * begin), (one, np.tile(begin, (2, 1))))
    for which, initial in wrong:
        expect_refused(f"{which}, {initial} for a restart", partial(walk.restart, which, initial))
    expect_refused("friction 0", partial(walk.restart, one, begin, friction=0.0 * firm))
    walk.restart(none, begin)
    expect(walk.status[1] is Status.HALTED, "a robot walks that was not restarted")
    walk.restart(one, begin, firm)
    walk = trial.engine.resume(walk.save())
    fresh = trial.engine.start(trial.robots[1], initial=begin, friction=firm, target=(0.9, 0.4), record=None)
    later: list[Command | None] = [None, *trial.commands()[:2]]
    for number, then in enumerate(later):
        for each, when in ((free, len(commands)), (walk, len(commands)), (fresh, 0)):
            each.advance((number + when) * period)
            if then is not None:
                each.command(_for_one(then) if each is fresh else then)
        expect(set(walk.status) == {Status.WALKED}, f"status is {walk.status}")
        _expect_alike(walk, 1, fresh, "of a restarted robot and a freshly started one")
    for name in ("joint_angles", "leg_yaw", "stiffness", "bearing"):
        here, there = (getattr(each.observe(), name)[[0, 2]] for each in (walk, free))
        expect(np.array_equal(here, there), f"{name} of the others is another")
    expect(np.array_equal(walk.states()[[0, 2]], free.states()[[0, 2]]), "states of the others are others")


def _for_one(command: Command) -> Command:
    given = {name: value for name, value in vars(command).items() if isinstance(value, np.ndarray)}
    own: dict[str, Any] = {name: value[1:2] for name, value in given.items()}
    return replace(command, **own)


def _expect_alike(walk: Walk, robot: int, alone: Walk, whose: str) -> None:
    """Check that a robot of a batch is at the position of a robot that walks alone."""
    seen, other = walk.observe(), alone.observe()
    for name, unit in (("joint_angles", "rad"), ("leg_yaw", "rad"), ("stiffness", "N*m/rad")):
        expect_near(getattr(seen, name)[robot], getattr(other, name)[0], _NEAR, f"{name} {whose}, {unit}")
    expect_near(walk.pose()[robot], alone.pose()[0], _NEAR, f"pose {whose}, m and rad")
