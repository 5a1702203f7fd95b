"""Walks that test an engine's promises, and comparisons of their results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from chilopod.engine.contract import Command, Engine, Walk
from chilopod.errors import ChilopodError
from chilopod.frozen import Array
from chilopod.record import Recording
from chilopod.robot import Robot

if TYPE_CHECKING:
    import xarray as xr

TIMES = (0.35, 0.8, 1.3)
"""Times of the commands of every walk, s."""

END = 2.0
"""Duration of every walk, s."""

_BENT = 0.2  # rad in all at the start


class Broken(Exception):
    """A broken promise; the message says what happened instead."""


class Trial:
    """An engine and the walks that test it."""

    def __init__(self, engine: Engine, robot: Robot, random: np.random.Generator) -> None:
        self.engine, self.random = engine, random
        adjustable = robot.override("springs.adjustable", True)
        most = max(robot.springs.stiffness)
        others = (adjustable.with_value("springs.stiffness[0]", part * most) for part in (0.3, 1))
        self.robot, self.robots = robot, (adjustable, *others)
        joints = robot.body.modules - 1
        self.bends = _BENT / joints * random.uniform(-1.0, 1.0, (len(self.robots), joints))

    def start(
        self, which: Sequence[int] = (0, 1, 2), seeds: Sequence[int] | None = (7, 8, 9), **options: object
    ) -> Walk:
        """Start some of the robots, bent, with a target."""
        given = {"target": (0.9, 0.4), "record": Recording(rate=50.0), "expected": END, **options}
        headings, places = np.full(len(which), 0.3), np.tile([0.2, -0.1], (len(which), 1))
        initial = self.engine.initial_states(self.robot, self.bends[list(which)], headings, places)
        chosen = None if seeds is None else [seeds[i] for i in which]
        return self.engine.start([self.robots[i] for i in which], initial=initial, seeds=chosen, **given)  # type: ignore[arg-type]

    def commands(self, which: Sequence[int] = (0, 1, 2)) -> list[Command]:
        """Commands of every walk at :data:`TIMES`."""
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

    def led(self, walk: Walk, at: Mapping[float, Callable[[Walk], Walk]], which: Sequence[int] = (0, 1, 2)) -> Walk:
        """Walk to the end with the commands; at some times, before a command, continue with the result of a function of
        the walk."""
        commands_at = dict(zip(TIMES, self.commands(which), strict=True))
        for time in sorted({*TIMES, *at, END}):
            if time > walk.time:
                walk.advance(time)
            walk = at[time](walk) if time in at else walk
            if time in commands_at:
                walk.command(commands_at[time])
        return walk

    def walked(self, walk: Walk, which: Sequence[int] = (0, 1, 2), stops: Sequence[float] = ()) -> xr.Dataset:
        """Record of a walk with the commands that is also interrupted and observed."""
        return self.led(walk, dict.fromkeys((*TIMES, *stops, END), _looked_at), which).to_dataset()


def _looked_at(walk: Walk) -> Walk:
    walk.observe()
    return walk


def expect_same(a: xr.Dataset, b: xr.Dataset, what: str) -> None:
    """Expect two records that are equal to the bit."""
    if set(a.variables) != set(b.variables):
        raise Broken(f"{what}: variables {sorted(set(a.variables) ^ set(b.variables), key=str)} are in one record only")
    for name in a.variables:
        if not a[name].equals(b[name]):
            raise Broken(f"{what}: {name} is another")


def expect(condition: object, otherwise: str) -> None:
    """Expect a condition; otherwise raise with the observed fact."""
    if not condition:
        raise Broken(otherwise)


def expect_refused(what: str, attempt: Callable[[], object]) -> None:
    """Expect that a call raises an error of chilopod."""
    try:
        attempt()
    except ChilopodError:
        return
    except Exception as error:
        raise Broken(f"{what} raises {type(error).__name__}, not a ChilopodError") from None
    raise Broken(f"{what} is accepted")


def expect_near(found: Array, wanted: Array, within: float, what: str) -> None:
    """Expect numbers within a tolerance, and NaN where NaN is expected."""
    if found.shape != wanted.shape or not np.allclose(found, wanted, rtol=0.0, atol=within, equal_nan=True):
        raise Broken(f"{what}: {np.array2string(found.ravel()[:6], precision=6)} instead of {wanted.ravel()[:6]}")
