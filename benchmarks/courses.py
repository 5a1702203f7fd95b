"""What it costs to walk courses of five targets, beside the same robots, steered as often, towards one far place.

Run by `make bench`; rewrites a table in README.md. The bare loop has the same springs to set, events and records, but
no referee who looks ten times a second, puts up targets and lets robots end, and nothing is summed up of its records.

Two threads are also timed while other processes keep all cores but one busy, beside one thread on its own.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numba
import numpy as np

from chilopod.cores import cores
from chilopod.engine import engine_named, steer
from chilopod.robot import load_robot
from chilopod.steering import VARIABLE
from chilopod.tasks.course import Driver, driver, random_courses
from chilopod.trials import Trial, batches, walked

from _timing import duration, machine, table, write_section

ROBOTS = {"planar": ("aoi2022-planar", 64), "twin": ("aoi2022", 8)}
ROUNDS = 2


def courses(ready: Driver, count: int) -> list[Trial]:
    seeds = range(1000, 1000 + count)
    return [
        ready.trial(course, seed, brief=True)
        for seed, course in zip(seeds, random_courses(seeds, ready.engine), strict=True)
    ]


def driven(batch: list[Trial]) -> tuple[float, float]:
    """Seconds for a batch, and how long its robots walked on average, s."""
    begin = time.perf_counter()
    records = walked(batch)
    taken = time.perf_counter() - begin
    return taken, float(np.mean([np.nanmax(record.goal_end.values) for record in records]))


def bare(batch: list[Trial], seconds: float) -> float:
    """Seconds for the same robots towards a place that they never get to."""
    engine, first = engine_named(batch[0].engine), batch[0]
    bends = np.random.default_rng(0).normal(0.0, 0.02, (len(batch), first.robot.body.modules - 1))
    begin = time.perf_counter()
    walk = engine.start(
        [trial.robot for trial in batch],
        initial=engine.initial_states(first.robot, bends),
        target=np.tile([50.0, 50.0], (len(batch), 1)),
        record=first.recording,
        expected=seconds,
    )
    steer(walk, seconds, first.controller)
    walk.to_dataset()
    return time.perf_counter() - begin


@contextmanager
def busy(count: int) -> Iterator[None]:
    """So many other processes that compute all the time."""
    others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def row(engine: str, threads: int, others: int = 0) -> list[str]:
    name, count = ROBOTS[engine]
    ready = driver(load_robot(name), VARIABLE, engine=engine)
    groups = batches(courses(ready, count))
    driven([replace(groups[0][0])])  # compiled
    taken, alone = [], []
    with busy(others):
        for _ in range(ROUNDS):
            times = [driven(group) for group in groups]
            taken.append(sum(each for each, _ in times))
            alone.append(sum(bare(group, seconds) for group, (_, seconds) in zip(groups, times, strict=True)))
    least, loop = min(taken), min(alone)
    about = [engine, str(count), str(threads), str(others)]
    return [*about, duration(least), f"{count / least:.2g}", f"{loop / least:.2f}"]


def main() -> None:
    load, threads = os.getloadavg()[0], numba.get_num_threads()
    rows = []
    for used in sorted({1, threads}):
        numba.set_num_threads(used)
        rows.append(row("planar", used))
    if threads > 1:
        rows.append(row("planar", threads, others=cores() - 1))
    rows.append(row("twin", threads))
    head = [
        "engine",
        "courses",
        "threads",
        "busy processes beside",
        "time",
        "courses per second",
        "of the bare loop's speed",
    ]
    about = f"{machine()} Load average before: {load:.1f}."
    title = "**Random courses of five targets, the first spring set once a gait cycle**"
    write_section("courses", f"{about}\n\n{title}\n\n{table(head, rows)}")


if __name__ == "__main__":
    main()
