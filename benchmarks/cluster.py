"""Studies on worker processes of one machine: two and four beside one, start-up aside; what a batch and a record cost.

Rewrites its table in README.md; not part of `make bench`, which has enough to do. They take turns, each with one thread
a worker, and of each the best of several timings counts, so that a busy machine harms them alike.
"""

from __future__ import annotations

import os
import pickle
import time
from contextlib import ExitStack
from dataclasses import replace

from chilopod.robot import load_robot
from chilopod.steering import LegYawController, Target
from chilopod.trials import Cluster, Here, Trial, run
from chilopod.trials.on_worker import packed, unpacked
from chilopod.trials.store import content_of

from _timing import duration, machine, median_seconds, table, write_section

ROUNDS = 3
WORKERS = (1, 2, 4)
TARGET = Target.parse("45 deg, 1.3 m")
PLANAR, WHOLE = load_robot("aoi2022-planar"), load_robot("aoi2022")
STUDIES = {
    "200 planar walks of 240 s": [Trial(PLANAR, 240.0, seed, rate=20.0) for seed in range(200)],
    "200 planar walks of 60 s, records at 100 Hz": [Trial(PLANAR, 60.0, seed) for seed in range(200)],
    "20 twin trials, task A": [
        Trial(WHOLE, 23.0, seed, target=TARGET, controller=LegYawController(), engine="twin") for seed in range(20)
    ],
}


def taken(trials: list[Trial], where: Cluster) -> float:
    begin = time.perf_counter()
    run(trials, executor=where)
    return time.perf_counter() - begin


def main() -> None:
    load = os.getloadavg()[0]
    best: dict[tuple[str, int], float] = {}
    with ExitStack() as stack:
        begin = time.perf_counter()
        two = stack.enter_context(Cluster(2, threads=1))
        start = time.perf_counter() - begin
        clusters = {n: two if n == 2 else stack.enter_context(Cluster(n, threads=1)) for n in WORKERS}
        for trials in STUDIES.values():  # what is loaded and compiled on first use
            for where in clusters.values():
                run([replace(trial, duration=1.0) for trial in trials[:16]], executor=where)
        for _ in range(ROUNDS):
            for name, trials in STUDIES.items():
                for count, where in clusters.items():
                    best[name, count] = min(best.get((name, count), float("inf")), taken(trials, where))
        nothing = [[replace(STUDIES["20 twin trials, task A"][0], engine="planar", duration=0.01)]] * 200
        begin = time.perf_counter()
        walked = sum(1 for _ in clusters[1].walk(nothing))
        per_task = (time.perf_counter() - begin) / walked
    here = median_seconds(lambda: list(Here().walk(nothing[:20]))) / 20
    rows = [
        [
            name,
            *(duration(best[name, n]) for n in WORKERS),
            *(f"{best[name, 1] / best[name, n]:.2f}" for n in WORKERS[1:]),
        ]
        for name in STUDIES
    ]
    head = ["study", "one worker", "two", "four", "two are faster by", "four by"]
    batch = STUDIES["200 planar walks of 60 s, records at 100 Hz"][:16]
    records = run(batch)
    answer = pickle.dumps(records, pickle.HIGHEST_PROTOCOL)
    note = (
        f"Two workers are there after {duration(start)}. A batch of one walk of next to nothing takes "
        f"{duration(per_task)} on a cluster and {duration(here)} here. A batch of {len(batch)} trials is "
        f"{len(packed(batch)) / 1e3:.1f} kB on its way there; a record of 60 s at 100 Hz is "
        f"{len(answer) / len(batch) / 1e6:.2f} MB on its way back, which the client reads in "
        f"{duration(median_seconds(lambda: unpacked(answer)) / len(batch))} and turns into a file's bytes in "
        f"{duration(median_seconds(lambda: content_of(records[0])))}. "
        f"Load average of the machine before: {load:.1f}."
    )
    title = "**Worker processes of one thread each, start-up aside**"
    write_section("cluster", f"{machine()}\n\n{title}\n\n{table(head, rows)}\n\n{note}")


if __name__ == "__main__":
    main()
