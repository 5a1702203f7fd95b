"""Steps a second of an environment: the batch of chilopod beside Gymnasium's own ways to step many, and the bare walk.

Run by `make bench`; rewrites a table in README.md. A step is a gait cycle of one robot with two commands. Everybody
gets the same random actions. The bare walk is told the same and advances as far, and is neither judged nor looked at.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import multiprocessing
import time
from collections.abc import Callable

import gymnasium
import numba
import numpy as np
from gymnasium.vector import VectorEnv

from chilopod import load_robot, planar
from chilopod.gym import Actions

from _timing import duration, machine, table, write_section

TURN = "chilopod.gym:chilopod/Turn-v0"
COUNTS = {1: 300, 32: 30, 1024: 5}
"""Robots, and how many steps of all of them are timed at a time."""

MOST_PROCESSES = 32
ROUNDS = 3


def stepped(env: VectorEnv, steps: int) -> float:
    """Seconds for a step of all robots, on average."""
    random, count = np.random.default_rng(0), env.num_envs
    env.reset(seed=0)
    taken = []
    for _ in range(steps):
        actions = random.uniform(-1.0, 1.0, (count, *env.single_action_space.shape)).astype(np.float32)
        begin = time.perf_counter()
        env.step(actions)
        taken.append(time.perf_counter() - begin)
    return float(np.mean(taken[1:]))


def bare(count: int, steps: int) -> float:
    """Seconds for as long a walk of as many robots."""
    random, actions = np.random.default_rng(0), Actions.of(load_robot("aoi2022-planar"))
    robot, yaw = actions.robot, np.zeros((count, 2))
    bends = np.random.default_rng(1).normal(0.0, 0.02, (count, robot.body.modules - 1))
    walk = planar.start(robot, initial=planar.initial_states(robot, bends), record=None)
    taken = []
    for step in range(steps):
        told = actions.commands(random.uniform(-1.0, 1.0, (count, len(actions.names))), yaw)
        begin = time.perf_counter()
        for phase, command in told:
            walk.advance((step + phase) * robot.gait.period)
            walk.command(command)
        walk.advance((step + 1) * robot.gait.period)
        taken.append(time.perf_counter() - begin)
        yaw = np.asarray(told[-1][1].leg_yaw)
    return float(np.mean(taken[1:]))


def least(measure: Callable[[], float], rounds: int) -> float:
    return min(measure() for _ in range(rounds))


def main() -> None:
    load = os.getloadavg()[0]
    # Processes that share the imports, and are forked before there are threads.
    multiprocessing.set_forkserver_preload(["chilopod.gym.envs", "chilopod.planar"])
    rows = []
    for count, steps in COUNTS.items():
        envs = {"chilopod, one batch": gymnasium.make_vec(TURN, count)}
        envs["Gymnasium, one after the other (Sync)"] = gymnasium.make_vec(TURN, count, vectorization_mode="sync")
        if count <= MOST_PROCESSES:
            envs["Gymnasium, a process each (Async)"] = gymnasium.make_vec(
                TURN, count, vectorization_mode="async", vector_kwargs={"context": "forkserver"}
            )
        times = {who: [] for who in ("the bare walk", *envs)}
        for _ in range(ROUNDS):
            times["the bare walk"].append(bare(count, steps))
            for who, env in envs.items():
                times[who].append(stepped(env, steps))
        for env in envs.values():
            env.close()
        ours = min(times["chilopod, one batch"])
        for who, each in times.items():
            taken = min(each)
            rows.append([str(count), who, duration(taken), f"{count / taken:.3g}", f"{ours / taken:.2f}"])
    head = ["robots", "who", "a step of all", "steps a second", "of the batch's speed"]
    about = f"{machine()} {numba.get_num_threads()} threads. Load average before: {load:.1f}."
    title = "**Random actions in `chilopod/Turn-v0`, planar**"
    write_section("gym", f"{about}\n\n{title}\n\n{table(head, rows)}")


if __name__ == "__main__":
    main()
