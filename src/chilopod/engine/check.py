"""Tries the promises of the contract on any engine, as Gymnasium's ``check_env`` does for environments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from chilopod.engine.contract import Array, Command, Engine, Observation, Status, Traits, Walk
from chilopod.errors import AnalysisError, ChilopodError
from chilopod.record import Recording
from chilopod.robot import Robot

if TYPE_CHECKING:
    import xarray as xr

_TIMES = (0.35, 0.8, 1.3)  # s, of the commands that every trial gets
_BREAKS = 0.6  # s
_END = 2.0  # s
_BENT = 0.2  # rad in all at the start
_HUGE = 1e4  # N*m: no joint withstands it


def check_engine(engine: Engine, robot: Robot, seed: int = 0) -> tuple[str, ...]:
    """Try whether an engine keeps what :mod:`chilopod.engine.contract` promises; takes a few walks of two seconds.

    Parameters
    ----------
    engine
        A module such as :mod:`chilopod.planar`, or an object.
    robot
        One that it knows. Its springs are made adjustable for some of the walks.
    seed
        Of the odd instants at which the walks are interrupted.

    Returns
    -------
    The promises that were tried, and kept.

    Raises
    ------
    AnalysisError
        At the first that is broken: which, and what was seen instead.
    """
    trial = _Trial(engine, robot, np.random.default_rng(seed))
    for promise, attempt in _PROMISES.items():
        try:
            attempt(trial)
        except _Broken as broken:
            raise AnalysisError(f"{promise}: {broken}", field=f"engine {engine.traits.name}") from None
    return tuple(_PROMISES)


class _Broken(Exception):
    """What was seen where something else was promised."""


class _Trial:
    """An engine and the walks that it is tried with."""

    def __init__(self, engine: Engine, robot: Robot, random: np.random.Generator) -> None:
        self.engine, self.random = engine, random
        adjustable = robot.override("springs.adjustable", True)
        softer = [
            adjustable.with_value("springs.stiffness[0]", part * max(robot.springs.stiffness)) for part in (0.3, 1)
        ]
        self.robot, self.robots = robot, (adjustable, *softer)
        joints = robot.body.modules - 1
        self.bends = _BENT / joints * random.uniform(-1.0, 1.0, (len(self.robots), joints))

    def start(
        self, which: Sequence[int] = (0, 1, 2), seeds: Sequence[int] | None = (7, 8, 9), **options: object
    ) -> Walk:
        """Some of the robots, bent, with a target."""
        given = {"target": (0.9, 0.4), "record": Recording(rate=50.0), "expected": _END, **options}
        headings, places = np.full(len(which), 0.3), np.tile([0.2, -0.1], (len(which), 1))
        initial = self.engine.initial_states(self.robot, self.bends[list(which)], headings, places)
        chosen = None if seeds is None else [seeds[i] for i in which]
        return self.engine.start([self.robots[i] for i in which], initial=initial, seeds=chosen, **given)  # type: ignore[arg-type]

    def commands(self, which: Sequence[int] = (0, 1, 2)) -> list[Command]:
        """What every walk is told, at :data:`_TIMES`."""
        count, joints = len(which), self.robot.body.modules - 1
        stiffness = np.array([self.robots[i].springs.stiffness for i in which])
        stiffness[:, 0] *= 0.6
        torque = np.zeros((count, joints))
        torque[:, -1] = 0.02 * stiffness[:, -1]
        return [
            Command(leg_yaw=np.full((count, 2), 0.08), within=0.1),
            Command(stiffness=stiffness, within=0.4),
            Command(joint_torque=torque),
        ]

    def walked(self, walk: Walk, which: Sequence[int] = (0, 1, 2), stops: Sequence[float] = ()) -> xr.Dataset:
        """The record of a walk with the commands, interrupted and looked at besides."""
        told = dict(zip(_TIMES, self.commands(which), strict=True))
        for time in sorted({*_TIMES, *stops, _END}):
            if time > walk.time:
                walk.advance(time)
            walk.observe()
            if time in told:
                walk.command(told[time])
        return walk.to_dataset()


def _same(a: xr.Dataset, b: xr.Dataset, what: str) -> None:
    if set(a.variables) != set(b.variables):
        raise _Broken(
            f"{what}: variables {sorted(set(a.variables) ^ set(b.variables), key=str)} are in one record only"
        )
    for name in a.variables:
        if not a[name].equals(b[name]):
            raise _Broken(f"{what}: {name} is another")


def _expect(condition: object, otherwise: str) -> None:
    if not condition:
        raise _Broken(otherwise)


def _refused(what: str, attempt: Callable[[], object]) -> None:
    try:
        attempt()
    except ChilopodError:
        return
    except Exception as error:
        raise _Broken(f"{what} ends in {type(error).__name__}, not in a ChilopodError") from None
    raise _Broken(f"{what} is accepted")


def _traits(trial: _Trial) -> None:
    traits = trial.engine.traits
    _expect(isinstance(traits, Traits), f"traits are a {type(traits).__name__}")
    _expect(traits.name and traits.sentence, "it has no name or no sentence")
    _expect(traits.a_core >= 1 and traits.a_round >= 1 and traits.haste > 0.0, "numbers of traits are not positive")
    _expect(trial.engine.common(trial.robot) == trial.engine.common(trial.robot), "common changes from call to call")
    hash(trial.engine.common(trial.robot))


def _sight(trial: _Trial) -> None:
    walk = trial.start(seeds=None)
    _expect(isinstance(walk, Walk), "start gives no Walk")
    _expect(walk.robots == trial.robots, "robots are not those it was given")
    _expect(walk.time == 0.0 and set(walk.status) == {Status.WALKED}, "a walk does not begin at 0 s, all walking")
    seen, count, joints = walk.observe(), len(trial.robots), trial.robot.body.modules - 1
    shapes = {"bearing": (count,), "distance": (count,), "leg_yaw": (count, 2)}
    shapes |= {"joint_angles": (count, joints), "stiffness": (count, joints)}
    for name, shape in shapes.items():
        array = getattr(seen, name)
        _expect(array.shape == shape and array.dtype == np.float64, f"{name} has shape {array.shape}, not {shape}")
    _near(seen.joint_angles, trial.bends, 1e-6, "joint_angles are not those it started with, rad")
    _near(seen.stiffness, np.array([each.springs.stiffness for each in trial.robots]), 1e-9, "stiffness, N*m/rad")
    _near(seen.leg_yaw, np.zeros((count, 2)), 0.0, "leg_yaw is not 0 before a command")
    away = np.array([0.9, 0.4]) - [0.2, -0.1]
    _near(seen.distance, np.full(count, np.hypot(*away)), 0.02, "distance of the target, m")
    _near(seen.bearing, np.full(count, np.arctan2(away[1], away[0]) - 0.3), 0.02, "bearing of the target, rad")
    nothing = trial.engine.start(trial.robot).observe()
    _expect(
        np.isnan(nothing.bearing).all() and np.isnan(nothing.distance).all(), "a target is seen where there is none"
    )
    for name in shapes:
        getattr(seen, name)[:] = 123.0
    again = walk.observe()
    _expect(
        all((getattr(again, name) != 123.0).all() for name in shapes), "writing into an observation changes the walk"
    )


def _records(trial: _Trial) -> None:
    data = trial.walked(trial.start())
    count, joints = len(trial.robots), trial.robot.body.modules - 1
    expected = {
        "position": (("time", "robot", "axis"), "m"),
        "velocity": (("time", "robot", "axis"), "m/s"),
        "heading": (("time", "robot"), "rad"),
        "heading_rate": (("time", "robot"), "rad/s"),
        "joint_angle": (("time", "robot", "joint"), "rad"),
        "joint_rate": (("time", "robot", "joint"), "rad/s"),
        "leg_yaw": (("time", "robot", "side"), "rad"),
        "stiffness": (("time", "robot", "joint"), "N*m/rad"),
        "distance": (("time", "robot"), "m"),
        "bearing": (("time", "robot"), "rad"),
        "command": (("event", "robot", "side"), "rad"),
        "command_stiffness": (("event", "robot", "joint"), "N*m/rad"),
    }
    for name, (dims, units) in expected.items():
        _expect(name in data, f"{name} is missing")
        _expect(data[name].dims == dims, f"{name} is over {data[name].dims}, not {dims}")
        _expect(data[name].attrs.get("units") == units, f"{name} is in {data[name].attrs.get('units')}, not {units}")
    _expect((data.sizes["robot"], data.sizes["joint"]) == (count, joints), "the record has other robots or joints")
    _near(data.time.values, np.arange(101) / 50.0, 0.02, "time: 50 samples a second up to the end, s")
    _near(data.position.values[0], np.tile([0.2, -0.1], (count, 1)), 1e-6, "position at the start, m")
    _near(data.heading.values[0], np.full(count, 0.3), 1e-6, "heading at the start, rad")
    _expect(data.status.values.tolist() == ["walked"] * count, f"status is {data.status.values.tolist()}")
    _near(data.event.values, np.array(_TIMES), 1e-9, "event: the times of commands, s")
    _expect(data.attrs.get("engine") == trial.engine.traits.name, "the attribute engine is not the engine's name")
    length = float(np.linalg.norm(data.position[-1, 0] - data.position[0, 0]))
    usual = _END * trial.robot.gait.speed
    _expect(
        0.1 * usual < length < 3.0 * usual, f"in {_END:g} s it went {length:.3g} m, the straight walk {usual:.3g} m"
    )
    nothing = trial.walked(trial.start(record=None))
    _expect(nothing.sizes["time"] == 0, "without a record there are samples")


def _determinism(trial: _Trial) -> None:
    _same(trial.walked(trial.start()), trial.walked(trial.start()), "the same walk twice")


def _splitting(trial: _Trial) -> None:
    whole = trial.walked(trial.start())
    stops = np.round(trial.random.uniform(0.0, _END, 40), 4)
    _same(whole, trial.walked(trial.start(), stops=stops.tolist()), "in one piece and in forty, looked at between")


def _batching(trial: _Trial) -> None:
    together = trial.walked(trial.start())
    for i in range(len(trial.robots)):
        alone = trial.walked(trial.start([i]), [i])
        part = together.isel(robot=[i]).assign_coords(robot=[0])
        _same(part, alone, f"robot {i} in a batch and alone")


def _saving(trial: _Trial) -> None:
    whole, walk = trial.walked(trial.start()), trial.start()
    told = dict(zip(_TIMES, trial.commands(), strict=True))
    for time in sorted({*_TIMES, *np.round(trial.random.uniform(0.0, _END, 5), 4).tolist(), _END}):
        walk.advance(time)
        saved = walk.save()
        walk = trial.engine.resume(saved)
        _expect(walk.time == time, f"saved at {time} s, it goes on at {walk.time} s")
        if time in told:
            walk.command(told[time])
    _same(whole, walk.to_dataset(), "in one piece and saved and resumed")
    _refused("a saved walk with a changed byte", lambda: trial.engine.resume(saved[:-9] + b"?" + saved[-8:]))
    _refused("half a saved walk", lambda: trial.engine.resume(saved[: len(saved) // 2]))
    _refused("a saved walk that is none", lambda: trial.engine.resume(b"walk"))


def _noise(trial: _Trial) -> None:
    def seen(seeds: Sequence[int] | None) -> Array:
        walk = trial.start(seeds=seeds)
        walk.advance(0.5)
        return walk.observe().bearing

    none, some, same, others = seen(None), seen((1, 2, 3)), seen((1, 2, 3)), seen((4, 5, 6))
    _expect(np.array_equal(some, same, equal_nan=True), "the same seeds give another bearing")
    noisy = trial.engine.traits.noisy
    _expect(np.array_equal(some, others, equal_nan=True) != noisy, f"noisy is {noisy}, and seeds say otherwise")
    _expect(np.array_equal(none, some, equal_nan=True) != noisy, f"noisy is {noisy}, and without seeds it is otherwise")


def _refusals(trial: _Trial) -> None:
    whole, walk = trial.walked(trial.start()), trial.start()
    walk.advance(_TIMES[0])
    count, joints = len(trial.robots), trial.robot.body.modules - 1
    stiffness = np.array([each.springs.stiffness for each in trial.robots])
    _refused("walking back", lambda: walk.advance(0.1))
    _refused("walking on to NaN", lambda: walk.advance(float("nan")))
    _refused("walking on for ever", lambda: walk.advance(float("inf")))
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
        _refused(what, partial(walk.command, command))
    _same(whole, trial.walked(walk), "without and with commands that were refused")
    fixed = trial.engine.start(trial.robot.override("springs.adjustable", False))
    softer = Command(stiffness=stiffness[:1] * 0.9)
    _refused("softening a spring that is not adjustable", lambda: fixed.command(softer))
    fixed.command(Command(stiffness=fixed.observe().stiffness))
    _refused("no robots", lambda: trial.engine.start([]))
    _refused("friction 0", lambda: trial.engine.start(trial.robot, friction=np.zeros((joints + 1, 2))))
    _refused("a target of one number", lambda: trial.engine.start(trial.robot, target=1.0))


def _springs(trial: _Trial) -> None:
    first = float(trial.robot.springs.stiffness[0])
    limited = trial.robot.override("springs.adjustable", True)
    limited = limited.override("springs.softest", 0.5 * first).override("springs.rate", 0.5 * first)
    walk = trial.engine.start(limited)
    wanted = np.array([trial.robot.springs.stiffness])
    wanted[0, 0] = 0.1 * first
    walk.command(Command(stiffness=wanted))
    walk.advance(0.5)
    _near(walk.observe().stiffness[:, 0], np.array([0.75 * first]), 1e-9, "half a second at 0.5 k/s, N*m/rad")
    walk.advance(1.5)
    _near(walk.observe().stiffness[:, 0], np.array([0.5 * first]), 1e-9, "softest 0.5 k after a command of 0.1 k")
    data = walk.to_dataset()
    _near(data.command_stiffness.values[0], wanted, 1e-12, "command_stiffness: what was asked for")
    ramp = first * np.maximum(1.0 - 0.5 * data.time.values, 0.5)
    _near(data.stiffness.values[:, 0, 0], ramp, 1e-9, "stiffness over time, N*m/rad")


def _driving(trial: _Trial) -> None:
    joints = trial.robot.body.modules - 1
    walk = trial.engine.start(trial.robot)
    push = np.zeros((1, joints))
    push[0, 0] = 0.2 * trial.robot.springs.stiffness[0]
    walk.command(Command(joint_torque=push, leg_yaw=[[0.1, -0.05]], within=0.1))
    walk.advance(_END)
    seen = walk.observe()
    _expect(seen.joint_angles[0, 0] > 0.02, f"a torque of 0.2 k bends joint 1 by {seen.joint_angles[0, 0]:.3g} rad")
    _near(seen.leg_yaw, np.array([[0.1, -0.05]]), 0.0, "leg_yaw is not what was commanded last")
    free = trial.engine.start(trial.robot)
    free.command(Command(joint_torque=push))
    free.command(Command(joint_torque=np.zeros((1, joints))))
    free.advance(_END)
    _near(free.observe().joint_angles, np.zeros((1, joints)), 0.05, "a torque that was taken back bends joints")


def _failures(trial: _Trial) -> None:
    joints = trial.robot.body.modules - 1
    breaking = np.zeros((len(trial.robots), joints))
    breaking[1] = _HUGE * trial.robot.springs.stiffness[0]

    def walked(torque: Array) -> tuple[Walk, Observation]:
        walk = trial.start()
        walk.advance(_BREAKS)
        before = walk.observe()
        walk.command(Command(joint_torque=torque))
        for time, command in zip(_TIMES[1:], trial.commands()[1:], strict=True):
            walk.advance(time)
            walk.observe()
            walk.command(command)
        walk.advance(_END)
        return walk, before

    (good, _), (walk, before) = walked(0.0 * breaking), walked(breaking)
    _expect(walk.status[1] is not Status.WALKED, "joints were torn round by 10 kN*m and more, and it walks on")
    _expect(walk.status[0] is walk.status[2] is Status.WALKED, "the others of the batch have not walked to the end")
    seen = walk.observe()
    for name in ("bearing", "distance", "joint_angles"):
        _expect(np.isnan(getattr(seen, name)[1]).all(), f"a robot that failed has {name}")
    _expect(np.array_equal(seen.leg_yaw[1], before.leg_yaw[1]), "a robot that failed obeys")
    data, undisturbed = walk.to_dataset(), good.to_dataset()
    for name in [str(name) for name, values in data.data_vars.items() if values.dims[:2] == ("time", "robot")]:
        values = data[name].values[:, 1].reshape(data.sizes["time"], -1)
        known = np.isfinite(values).all(axis=1)
        _expect(known[: int(_BREAKS * 50)].all(), f"{name} is NaN before it failed")
        _expect(np.isnan(values[~known]).all() and not known[-1], f"{name} is not NaN from where it failed on")
        _expect((np.diff(known.astype(int)) <= 0).all(), f"{name} comes back after it failed")
        for i in (0, 2):
            same = np.array_equal(data[name].values[:, i], undisturbed[name].values[:, i], equal_nan=True)
            _expect(same, f"{name} of robot {i} is another where robot 1 fails")


def _near(found: Array, wanted: Array, within: float, what: str) -> None:
    if found.shape != wanted.shape or not np.allclose(found, wanted, rtol=0.0, atol=within, equal_nan=True):
        raise _Broken(f"{what}: {np.array2string(found.ravel()[:6], precision=6)} instead of {wanted.ravel()[:6]}")


_PROMISES: dict[str, Callable[[_Trial], None]] = {
    "says what it is": _traits,
    "sees in the units and shapes of the contract": _sight,
    "records under the names, units and dimensions of the contract": _records,
    "gives the same bits twice": _determinism,
    "gives the same bits however it is advanced and looked at": _splitting,
    "gives the same bits alone and in a batch": _batching,
    "goes on to the bit when saved and resumed": _saving,
    "draws noise from its seeds alone": _noise,
    "refuses what is no command, and is as before": _refusals,
    "keeps springs within range and rate, and says so": _springs,
    "turns joints and legs the way it is told": _driving,
    "ends a robot that fails with a status and NaN, and walks on with the others": _failures,
}
