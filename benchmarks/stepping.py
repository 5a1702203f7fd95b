"""What it costs to walk step by step: robots advanced, looked at and commanded every 33 ms, beyond the motion itself.

Run by `make bench`; rewrites a table in README.md. For the planar model the motion itself is the time spent within the
compiled loops, on one thread; looking between two cuts carries a copy of the robot there, which counts as motion and is
shown. For the twin it is MuJoCo's own batch in pieces of as many steps, with the same controls.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import numba
import numpy as np
from mujoco.batch import Batch

from chilopod import planar, twin
from chilopod.engine import Command, Observation, Walk
from chilopod.planar import stretch
from chilopod.record import Recording
from chilopod.robot import Robot, load_robot

from _timing import duration, machine, table, write_section

STEP = 0.033  # s
ROUNDS = 3
PLANAR = load_robot("aoi2022-planar").override("springs.adjustable", True)
TWIN = load_robot("aoi2022")
LOOPS = ("walk", "walk_abreast", "walk_alone")


def yawed(seen: Observation) -> Command:
    yaw = np.clip(0.2 * seen.bearing, -0.1, 0.1)
    return Command(leg_yaw=np.stack([yaw, yaw], axis=-1), within=STEP)


def softer(seen: Observation) -> Command:
    """Every spring to nine tenths of what it began with or back, at constant rate."""
    start = PLANAR.springs.stiffness[0]
    return Command(stiffness=np.where(seen.stiffness < 0.95 * start, start, 0.9 * start), within=STEP)


MODES: dict[str, Callable[[Walk], object]] = {
    "advance": lambda walk: None,
    "advance, observe": lambda walk: walk.observe(),
    "advance, observe, command leg yaw": lambda walk: walk.command(yawed(walk.observe())),
    "advance, observe, command stiffness": lambda walk: walk.command(softer(walk.observe())),
}


def started(engine: Any, robot: Robot, count: int, record: Recording | None) -> Walk:
    bends = np.random.default_rng(0).normal(0.0, 0.02, (count, robot.body.modules - 1))
    initial = engine.initial_states(robot, bends)
    walk: Walk = engine.start(robot, initial=initial, target=(2.0, 1.0), record=record)
    return walk


def stepped(walk: Walk, steps: int, act: Callable[[Walk], object]) -> float:
    begin = time.perf_counter()
    for _ in range(steps):
        walk.advance(walk.time + STEP)
        act(walk)
    return time.perf_counter() - begin


class Clock:
    """Sums the time spent within functions."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def around(self, call: Callable[..., None]) -> Callable[..., None]:
        def timed(*arguments: Any) -> None:
            begin = time.perf_counter()
            call(*arguments)
            self.seconds += time.perf_counter() - begin

        return timed


def planar_rows() -> list[list[str]]:
    rows, clock = [], Clock()
    originals = {name: getattr(stretch, name) for name in LOOPS}
    for name, loop in originals.items():
        setattr(stretch, name, clock.around(loop))
    try:
        for count, steps in ((1, 1500), (1000, 60)):
            for mode, act in MODES.items():
                beyond, within = [], []
                for _ in range(ROUNDS):
                    walk = started(planar, PLANAR, count, Recording(rate=30.0))
                    stepped(walk, 10, act)
                    clock.seconds = 0.0
                    taken = stepped(walk, steps, act)
                    beyond.append((taken - clock.seconds) / steps)
                    within.append(clock.seconds / steps)
                least = min(beyond)
                rows.append(
                    [f"planar, {count}", mode, duration(min(within)), duration(least), f"{1e6 * least / count:.2f} µs"]
                )
    finally:
        for name, loop in originals.items():
            setattr(stretch, name, loop)
    return rows


def twin_rows() -> list[list[str]]:
    """Ten robots on one thread, and MuJoCo's batch with the controls they were given, as often interrupted."""
    count, steps, rows = 10, 150, []
    for mode in list(MODES)[:3]:
        times, bare = [], []
        for _ in range(ROUNDS):
            given: list[Any] = []
            rollout = Batch.rollout

            def listening(
                self: Batch,
                nstep: int,
                control: Any = None,
                rollout: Any = rollout,
                given: list[Any] = given,
                **options: Any,
            ) -> Any:
                given.append(np.array(control))
                return rollout(self, nstep, control, **options)

            walk = twin.start(TWIN, initial=starts(count), target=(2.0, 1.0), record=Recording(rate=30.0), threads=1)
            Batch.rollout = listening
            try:
                stepped(walk, steps, MODES[mode])
            finally:
                Batch.rollout = rollout
            walk = twin.start(TWIN, initial=starts(count), target=(2.0, 1.0), record=Recording(rate=30.0), threads=1)
            times.append(stepped(walk, steps, MODES[mode]) / steps)
            batch = Batch(twin.TwinModel(TWIN).model, count, 1)
            batch.bind("qpos")[:] = starts(count)
            begin = time.perf_counter()
            for control in given:
                batch.rollout(control.shape[1], control, record=("qpos", "qvel"))
            bare.append((time.perf_counter() - begin) / steps)
        least = min(times) - min(bare)
        rows.append(
            [f"twin, {count}", mode, duration(min(bare)), duration(max(least, 0.0)), f"{1e6 * least / count:.2f} µs"]
        )
    return rows


def starts(count: int) -> Any:
    bends = np.random.default_rng(0).normal(0.0, 0.02, (count, TWIN.body.modules - 1))
    return twin.initial_states(TWIN, bends)


def main() -> None:
    load = os.getloadavg()[0]
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    head = ["robots", f"every {1e3 * STEP:.0f} ms", "motion, a step", "beyond it, a step", "beyond it, a robot"]
    rows = planar_rows() + twin_rows()
    numba.set_num_threads(threads)
    about = f"{machine()} Also mujoco {version('mujoco-core')}. Load average before: {load:.1f}."
    title = f"**Walks in steps of {1e3 * STEP:.0f} ms with a record at 30 Hz, one thread**"
    write_section("stepping", f"{about}\n\n{title}\n\n{table(head, rows)}")


if __name__ == "__main__":
    main()
