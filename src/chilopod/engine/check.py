"""Checker of the engine contract, comparable to Gymnasium's ``check_env`` for environments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from chilopod.engine.check_referee import BREAKS, aims, halts, places, restarts, states
from chilopod.engine.check_trial import END, TIMES, Broken, Trial, expect, expect_near, expect_refused, expect_same
from chilopod.engine.contract import Command, Engine, Observation, Status, Traits, Walk, missing_parts
from chilopod.errors import AnalysisError
from chilopod.frozen import Array
from chilopod.record import MOTION, QUANTITIES
from chilopod.robot import Robot

_HUGE = 1e4  # N*m: beyond what any joint withstands
_MOVED = 1e-5  # rad


def check_engine(engine: Engine, robot: Robot, seed: int = 0) -> tuple[str, ...]:
    """Check an engine against the promises of :mod:`chilopod.engine.contract` with a few walks of two seconds; return
    the promises, which were tested and kept.

    The engine is a module such as :mod:`chilopod.planar`, or an object, and can walk the robot, whose springs are made
    adjustable for some of the walks. The seed is that of the random instants at which the walks are interrupted. Raises
    AnalysisError at the first broken promise; the message says what happened instead.
    """
    trial = Trial(engine, robot, np.random.default_rng(seed))
    for promise, attempt in _PROMISES.items():
        try:
            attempt(trial)
        except Broken as broken:
            raise AnalysisError(f"{promise}: {broken}", field=f"engine {engine.traits.name}") from None
    return tuple(_PROMISES)


def _traits(trial: Trial) -> None:
    traits = trial.engine.traits
    expect(isinstance(traits, Traits), f"traits are a {type(traits).__name__}")
    expect(traits.name and traits.sentence, "name and sentence must not be empty")
    positive = min(traits.robots_per_core, traits.walks_per_round) >= 1 and traits.duration_ratio > 0.0
    expect(positive, "numbers of traits must be positive")
    expect(trial.engine.common(trial.robot) == trial.engine.common(trial.robot), "common changes from call to call")
    hash(trial.engine.common(trial.robot))


def _sight(trial: Trial) -> None:
    walk = trial.start(seeds=None)
    missing = missing_parts(walk)
    expect(not missing, f"start must return a Walk; missing: {', '.join(missing)}")
    expect(walk.robots == trial.robots, "robots differ from the given ones")
    expect(walk.time == 0.0 and set(walk.status) == {Status.WALKED}, "a walk must begin at 0 s with the status WALKED")
    seen, count, joints = walk.observe(), len(trial.robots), trial.robot.body.modules - 1
    shapes = {"bearing": (count,), "distance": (count,), "leg_yaw": (count, 2)}
    shapes |= {"joint_angles": (count, joints), "stiffness": (count, joints)}
    for name, shape in shapes.items():
        array = getattr(seen, name)
        expect(array.shape == shape and array.dtype == np.float64, f"{name} has shape {array.shape}, not {shape}")
    expect_near(seen.joint_angles, trial.bends, 1e-6, "joint_angles at the start, rad")
    expect_near(seen.stiffness, np.array([each.springs.stiffness for each in trial.robots]), 1e-9, "stiffness, N*m/rad")
    expect_near(seen.leg_yaw, np.zeros((count, 2)), 0.0, "leg_yaw before a command, rad")
    away = np.array([0.9, 0.4]) - [0.2, -0.1]
    expect_near(seen.distance, np.full(count, np.hypot(*away)), 0.02, "distance of the target, m")
    expect_near(seen.bearing, np.full(count, np.arctan2(away[1], away[0]) - 0.3), 0.02, "bearing of the target, rad")
    nothing = trial.engine.start(trial.robot).observe()
    unseen = np.isnan([nothing.bearing, nothing.distance]).all()
    expect(unseen, "bearing or distance is finite without a target")
    for name in shapes:
        getattr(seen, name)[:] = 123.0
    again = walk.observe()
    for name in shapes:
        expect((getattr(again, name) != 123.0).all(), "writing into an observation changes the walk")


def _records(trial: Trial) -> None:
    data = trial.walked(trial.start())
    count, joints = len(trial.robots), trial.robot.body.modules - 1
    named = *MOTION, "stiffness", "distance", "bearing", "command", "command_stiffness"
    for name, (dims, units, _) in ((name, QUANTITIES[name]) for name in named):
        expect(name in data, f"{name} is missing")
        expect(data[name].dims == dims, f"{name} has dimensions {data[name].dims}, not {dims}")
        expect(data[name].attrs.get("units") == units, f"{name} has unit {data[name].attrs.get('units')}, not {units}")
    sizes = data.sizes["robot"], data.sizes["joint"]
    expect(sizes == (count, joints), "the record has a wrong number of robots or joints")
    expect_near(data.time.values, np.arange(101) / 50.0, 0.02, "time: 50 samples a second up to the end, s")
    expect_near(data.position.values[0], np.tile([0.2, -0.1], (count, 1)), 1e-6, "position at the start, m")
    expect_near(data.heading.values[0], np.full(count, 0.3), 1e-6, "heading at the start, rad")
    expect(data.status.values.tolist() == ["walked"] * count, f"status is {data.status.values.tolist()}")
    expect_near(data.event.values, np.array(TIMES), 1e-9, "event: the times of commands, s")
    expect(data.attrs.get("engine") == trial.engine.traits.name, "the attribute engine differs from the engine's name")
    length = float(np.linalg.norm(data.position[-1, 0] - data.position[0, 0]))
    usual = END * trial.robot.gait.speed
    said = f"displacement in {END:g} s: {length:.3g} m, straight walk {usual:.3g} m"
    expect(0.1 * usual < length < 3.0 * usual, said)
    nothing = trial.walked(trial.start(record=None))
    expect(nothing.sizes["time"] == 0, "a walk without a record has samples")


def _determinism(trial: Trial) -> None:
    expect_same(trial.walked(trial.start()), trial.walked(trial.start()), "the same walk twice")


def _splitting(trial: Trial) -> None:
    whole, stops = trial.walked(trial.start()), np.round(trial.random.uniform(0.0, END, 40), 4).tolist()
    cut = trial.walked(trial.start(), stops=stops)
    expect_same(whole, cut, "one advance, and forty with observations between")


def _batching(trial: Trial) -> None:
    together = trial.walked(trial.start())
    for i in range(len(trial.robots)):
        alone = trial.walked(trial.start([i]), [i])
        part = together.isel(robot=[i]).assign_coords(robot=[0])
        expect_same(part, alone, f"robot {i} in a batch and alone")


def _saving(trial: Trial) -> None:
    def again(walk: Walk) -> Walk:
        same = trial.engine.resume(walk.save())
        expect(same.time == walk.time, f"saved at {walk.time} s, resumed at {same.time} s")
        return same

    whole, times = trial.walked(trial.start()), np.round(trial.random.uniform(0.0, END, 5), 4).tolist()
    walk = trial.led(trial.start(), dict.fromkeys((*TIMES, *times, END), again))
    saved = walk.save()
    expect_same(whole, walk.to_dataset(), "one run, and saved and resumed ones")
    expect_refused("a saved walk with a changed byte", lambda: trial.engine.resume(saved[:-9] + b"?" + saved[-8:]))
    expect_refused("half a saved walk", lambda: trial.engine.resume(saved[: len(saved) // 2]))
    expect_refused("bytes that are not a saved walk", lambda: trial.engine.resume(b"walk"))


def _noise(trial: Trial) -> None:
    def seen(seeds: Sequence[int] | None) -> Array:
        walk = trial.start(seeds=seeds)
        walk.advance(0.5)
        return walk.observe().bearing

    some, noisy = seen((1, 2, 3)), trial.engine.traits.noisy
    expect(np.array_equal(some, seen((1, 2, 3)), equal_nan=True), "equal seeds give different bearings")
    for seeds, what in (((4, 5, 6), "walks with different seeds"), (None, "a walk without seeds")):
        differs = not np.array_equal(some, seen(seeds), equal_nan=True)
        expect(differs == noisy, f"noisy is {noisy}, which contradicts {what}")


def _refusals(trial: Trial) -> None:
    whole, walk = trial.walked(trial.start()), trial.start()
    walk.advance(TIMES[0])
    count, joints = len(trial.robots), trial.robot.body.modules - 1
    stiffness = np.array([each.springs.stiffness for each in trial.robots])
    expect_refused("advancing to a past time", lambda: walk.advance(0.1))
    expect_refused("advancing to NaN", lambda: walk.advance(float("nan")))
    expect_refused("advancing to infinity", lambda: walk.advance(float("inf")))
    wrong: dict[str, Any] = {
        "three leg yaws": Command(leg_yaw=np.zeros((count, 3))),
        "leg yaw NaN": Command(leg_yaw=np.full((count, 2), np.nan)),
        "leg yaw of two turns": Command(leg_yaw=np.full((count, 2), 12.0)),
        "leg yaw of another number of robots": Command(leg_yaw=np.zeros((count + 1, 2))),
        "a negative stiffness": Command(stiffness=-stiffness),
        "stiffness NaN": Command(stiffness=np.nan * stiffness),
        "stiffness of one joint too many": Command(stiffness=np.ones((count, joints + 1))),
        "an infinite torque": Command(joint_torque=np.full((count, joints), np.inf)),
        "words for a torque": Command(joint_torque="much"),
        "a negative time": Command(leg_yaw=np.zeros((count, 2)), within=-1.0),
        "no command": None,
    }
    for what, command in wrong.items():
        expect_refused(what, partial(walk.command, command))
    expect_same(whole, trial.walked(walk), "without and with refused commands")
    fixed = trial.engine.start(trial.robot.override("springs.adjustable", False))
    softer = Command(stiffness=stiffness[:1] * 0.9)
    expect_refused("softening a spring that is not adjustable", lambda: fixed.command(softer))
    fixed.command(Command(stiffness=fixed.observe().stiffness))
    expect_refused("no robots", lambda: trial.engine.start([]))
    expect_refused("friction 0", lambda: trial.engine.start(trial.robot, friction=np.zeros((joints + 1, 2))))
    expect_refused("a target of one number", lambda: trial.engine.start(trial.robot, target=1.0))


def _springs(trial: Trial) -> None:
    first = float(trial.robot.springs.stiffness[0])
    limited = trial.robot.override("springs.adjustable", True)
    limited = limited.override("springs.softest", 0.5 * first).override("springs.rate", 0.5 * first)
    walk = trial.engine.start(limited)
    wanted = np.array([trial.robot.springs.stiffness])
    wanted[0, 0] = 0.1 * first
    walk.command(Command(stiffness=wanted))
    walk.advance(0.5)
    expect_near(walk.observe().stiffness[:, 0], np.array([0.75 * first]), 1e-9, "half a second at 0.5 k/s, N*m/rad")
    walk.advance(1.5)
    expect_near(walk.observe().stiffness[:, 0], np.array([0.5 * first]), 1e-9, "softest 0.5 k after a command of 0.1 k")
    data = walk.to_dataset()
    expect_near(data.command_stiffness.values[0], wanted, 1e-12, "command_stiffness, N*m/rad")
    ramp = first * np.maximum(1.0 - 0.5 * data.time.values, 0.5)
    expect_near(data.stiffness.values[:, 0, 0], ramp, 1e-9, "stiffness over time, N*m/rad")


def _driving(trial: Trial) -> None:
    push = np.zeros((1, trial.robot.body.modules - 1))
    push[0, 0] = 0.2 * trial.robot.springs.stiffness[0]
    legs = Command(leg_yaw=[[0.1, -0.05]], within=0.1)

    def walked(*torques: Array) -> tuple[float, Observation]:
        """Mean angle of joint 1 in the first moments, when no robot has swung back, and the observation at the end."""
        walk = trial.engine.start(trial.robot)
        for command in (legs, *(Command(joint_torque=torque) for torque in torques)):
            walk.command(command)
        walk.advance(END)
        data = walk.to_dataset()
        return float(data.joint_angle[data.time.values <= TIMES[0], 0, 0].mean()), walk.observe()

    # Joints of a heavy robot are slow, and its walk may undulate: only walks that are otherwise alike can be compared.
    (bend, free), (pushed, _), (_, back) = walked(), walked(push), walked(push, 0.0 * push)
    expect(pushed - bend > _MOVED, f"a torque of 0.2 k bends joint 1 by {pushed - bend:.3g} rad at first")
    expect_near(back.leg_yaw, np.array([[0.1, -0.05]]), 0.0, "leg_yaw after the last command, rad")
    expect_near(back.joint_angles, free.joint_angles, _MOVED, "joint_angles after a torque was set back to 0, rad")


def _failures(trial: Trial) -> None:
    joints = trial.robot.body.modules - 1
    breaking = np.zeros((len(trial.robots), joints))
    breaking[1] = _HUGE * trial.robot.springs.stiffness[0]

    def walked(torque: Array) -> tuple[Walk, Observation]:
        walk = trial.start()
        walk.advance(BREAKS)
        before = walk.observe()
        walk.command(Command(joint_torque=torque))
        for time, command in zip(TIMES[1:], trial.commands()[1:], strict=True):
            walk.advance(time)
            walk.observe()
            walk.command(command)
        walk.advance(END)
        return walk, before

    (good, _), (walk, before) = walked(0.0 * breaking), walked(breaking)
    expect(walk.status[1] is not Status.WALKED, "a robot still walks after a joint torque of 10 kN*m and more")
    expect(walk.status[0] is walk.status[2] is Status.WALKED, "the other robots of the batch must walk to the end")
    seen = walk.observe()
    for name in ("bearing", "distance", "joint_angles"):
        expect(np.isnan(getattr(seen, name)[1]).all(), f"a failed robot has a finite {name}")
    expect(np.array_equal(seen.leg_yaw[1], before.leg_yaw[1]), "a failed robot follows commands")
    data, undisturbed = walk.to_dataset(), good.to_dataset()
    for name in [str(name) for name, values in data.data_vars.items() if values.dims[:2] == ("time", "robot")]:
        values = data[name].values[:, 1].reshape(data.sizes["time"], -1)
        known = np.isfinite(values).all(axis=1)
        expect(known[: int(BREAKS * 50)].all(), f"{name} is NaN before the failure")
        expect(np.isnan(values[~known]).all() and not known[-1], f"{name} is finite after the failure")
        expect((np.diff(known.astype(int)) <= 0).all(), f"{name} is finite again after the failure")
        for i in (0, 2):
            same = np.array_equal(data[name].values[:, i], undisturbed[name].values[:, i], equal_nan=True)
            expect(same, f"{name} of robot {i} changes when robot 1 fails")


_PROMISES: dict[str, Callable[[Trial], None]] = {
    "has valid traits": _traits,
    "observes in the units and shapes of the contract": _sight,
    "records under the names, units and dimensions of the contract": _records,
    "repeats a walk to the bit": _determinism,
    "gives the same bits for any advances and observations": _splitting,
    "gives the same bits alone and in a batch": _batching,
    "continues to the bit when saved and resumed": _saving,
    "draws noise only from its seeds": _noise,
    "refuses invalid commands without a change": _refusals,
    "keeps springs within range and rate, and records them": _springs,
    "turns joints and legs as commanded": _driving,
    "stops a failed robot with a status and NaN, without effect on the others": _failures,
    "returns poses without a change of the walk": places,
    "moves targets without a change of the motion": aims,
    "halts robots finally, without effect on the others": halts,
    "returns states from which another walk continues": states,
    "restarts robots without effect on the others": restarts,
}
