"""Steered trials of the twin beside the bare MuJoCo loop of the same model and controls, on one and on two cores.

Run by `make bench`; rewrites a table in README.md. A trial is task A of the paper's turning experiment: 23 s towards a
target with leg yaw and scanner, recorded at 100 Hz. The bare loops get the controls that were given in the trials, row
by row, with the last state alone kept: mj_step called from C (mujoco.batch.Batch.rollout) and from Python. All calls
take turns, and of each the best of several timings counts, so that a busy machine harms them alike.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from chilopod.cores import cores
from chilopod.robot import load_robot
from chilopod.steering import LegYawController, Target
from chilopod.twin import TwinModel, initial_states, simulate

from _timing import duration, machine, table, write_section

TARGET = Target.parse("45 deg, 1.3 m")
SECONDS, RATE = 23.0, 100.0
TRIALS = 10
ROUNDS = 5
ROBOT = load_robot("aoi2022").set_from_text(["springs.stiffness[0]=21 N*mm/deg"])


def trials(count: int, threads: int) -> Any:
    """Closed loop: controller, scanner with noise, records."""
    return simulate(
        ROBOT,
        SECONDS,
        initial=starts(count),
        controller=LegYawController(),
        target=TARGET.position,
        seeds=list(range(count)),
        rate=RATE,
        threads=threads,
    )


def starts(count: int) -> Any:
    bends = np.random.default_rng(0).normal(0.0, np.radians(1.0), (TRIALS, ROBOT.body.modules - 1))
    return initial_states(ROBOT, bends[:count])


def controls_of(count: int) -> Any:
    """What the servos were told in the closed-loop trials, (count, steps, servos), and where these ended."""
    given: list[Any] = []
    rollout = Batch.rollout

    def listening(self: Batch, nstep: int, control: Any = None, **options: Any) -> Any:
        given.append(np.array(control))
        return rollout(self, nstep, control, **options)

    Batch.rollout = listening
    try:
        record = trials(count, 1)
    finally:
        Batch.rollout = rollout
    return np.concatenate(given, axis=1), record.isel(time=-1)


def bare(model: mujoco.MjModel, controls: Any, threads: int) -> Any:
    """The loop over mj_step in C; states in the end."""
    batch = Batch(model, len(controls), threads)
    batch.bind("qpos")[:] = starts(len(controls))
    batch.rollout(controls.shape[1], controls, record=())
    return batch.bind("qpos").copy()


def python_loop(model: mujoco.MjModel, controls: Any) -> Any:
    """The same from Python."""
    ends = []
    for start, control in zip(starts(len(controls)), controls, strict=True):
        data = mujoco.MjData(model)
        data.qpos[:] = start
        for row in control:
            data.ctrl[:] = row
            mujoco.mj_step(model, data)
        ends.append(data.qpos.copy())
    return np.array(ends)


def best_of_rounds(calls: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Shortest wall time of each call; they take turns."""
    best = dict.fromkeys(calls, np.inf)
    for _ in range(ROUNDS):
        for name, call in calls.items():
            begin = time.perf_counter()
            call()
            best[name] = min(best[name], time.perf_counter() - begin)
    return best


def main() -> None:
    load = os.getloadavg()[0]
    model = TwinModel(ROBOT).model
    controls, last = controls_of(TRIALS)
    threads = min(2, cores())
    ends = bare(model, controls, 1)
    same = np.array_equal(ends[:, :2], last.position.values) and np.array_equal(python_loop(model, controls), ends)
    # Who, on how many threads, how many walks, and the bare loop to compare with.
    calls: dict[str, tuple[Callable[[], object], int, str]] = {
        "**chilopod**, one trial": (lambda: trials(1, 1), 1, "one walk"),
        "mj_step in C, one walk": (lambda: bare(model, controls[:1], 1), 1, "one walk"),
        "mj_step from Python, one walk": (lambda: python_loop(model, controls[:1]), 1, "one walk"),
    }
    for count in (1, threads):
        where = f"{count} thread{'s' * (count > 1)}"
        calls[f"**chilopod**, {TRIALS} trials, {where}"] = (lambda n=count: trials(TRIALS, n), TRIALS, where)
        calls[f"mj_step in C, {TRIALS} walks, {where}"] = (lambda n=count: bare(model, controls, n), TRIALS, where)
    seconds = best_of_rounds({name: call for name, (call, _, _) in calls.items()})
    rows, ours, loops = [], [], []
    for name, (_, count, peer) in calls.items():
        (loop,) = [seconds[other] for other in calls if other.startswith("mj_step in C") and other.endswith(peer)]
        taken = seconds[name]
        speed = count * controls.shape[1] / taken
        rows.append([name, duration(taken), f"{speed:.0f}", f"{count * SECONDS / taken:.0f}", f"{loop / taken:.2f}"])
        if name.startswith("**") and count > 1:
            ours.append(taken)
            loops.append(loop)
    title = f"**Task A in three dimensions: {SECONDS:.0f} s of robot time towards {TARGET}, steps of 2 ms**"
    head = ["who", "time", "steps per second", "times real time", "of the C loop's speed"]
    note = (
        f"{threads} threads are {ours[0] / ours[-1]:.2f} times as fast as one (the bare loop: "
        f"{loops[0] / loops[-1]:.2f}). The bare loops end "
        f"{'in the same place to the bit' if same else 'ELSEWHERE'}. Load average of the machine before: {load:.1f}."
    )
    about = f"{machine()} Also mujoco {version('mujoco-core')}."
    write_section("twin", f"{about}\n\n{title}\n\n{table(head, rows)}\n\n{note}")


if __name__ == "__main__":
    main()
