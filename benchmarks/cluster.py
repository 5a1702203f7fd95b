"""Studies on worker processes of one machine: two beside one, start-up aside, and what a batch and a record cost.

Rewrites its table in README.md; not part of `make bench`, which has enough to do. One worker and two take turns, each
with one thread a worker, and of each the best of several timings counts, so that a busy machine harms them alike.
"""

from __future__ import annotations

import os
import pickle
import time
from dataclasses import replace

from chilopod.robot import load_robot
from chilopod.steering import LegYawController, Target
from chilopod.trials import Cluster, Here, Trial, run
from chilopod.trials.on_worker import packed, unpacked
from chilopod.trials.store import as_bytes

from _timing import duration, machine, median_seconds, table, write_section

ROUNDS = 4
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
    begin = time.perf_counter()
    with Cluster(2, threads=1) as two:
        start = time.perf_counter() - begin
        with Cluster(1, threads=1) as one:
            best: dict[tuple[str, int], float] = {}
            for trials in STUDIES.values():  # what is loaded and compiled on first use
                for where in (one, two):
                    run([replace(trial, duration=1.0) for trial in trials[:8]], executor=where)
            for _ in range(ROUNDS):
                for name, trials in STUDIES.items():
                    for where in (one, two):
                        key = name, where.workers
                        best[key] = min(best.get(key, float("inf")), taken(trials, where))
            nothing = [[replace(STUDIES["20 twin trials, task A"][0], engine="planar", duration=0.01)]] * 200
            begin = time.perf_counter()
            walked = sum(1 for _ in one.walk(nothing))
            per_task = (time.perf_counter() - begin) / walked
    here = median_seconds(lambda: list(Here().walk(nothing[:20]))) / 20
    rows = [
        [name, duration(best[name, 1]), duration(best[name, 2]), f"{best[name, 1] / best[name, 2]:.2f}"]
        for name in STUDIES
    ]
    head = ["study", "one worker", "two workers", "times as fast"]
    batch = STUDIES["200 planar walks of 60 s, records at 100 Hz"][:16]
    records = run(batch)
    answer = pickle.dumps(records, pickle.HIGHEST_PROTOCOL)
    note = (
        f"Two workers are there after {duration(start)}. A batch of one walk of next to nothing takes "
        f"{duration(per_task)} on a cluster and {duration(here)} here. A batch of {len(batch)} trials is "
        f"{len(packed(batch)) / 1e3:.1f} kB on its way there; a record of 60 s at 100 Hz is "
        f"{len(answer) / len(batch) / 1e6:.2f} MB on its way back, which the client reads in "
        f"{duration(median_seconds(lambda: unpacked(answer)) / len(batch))} and turns into a file's bytes in "
        f"{duration(median_seconds(lambda: as_bytes(records[0])))}. "
        f"Load average of the machine before: {load:.1f}."
    )
    title = "**Two worker processes beside one, each with one thread, start-up aside**"
    write_section("cluster", f"{machine()}\n\n{title}\n\n{table(head, rows)}\n\n{note}")


if __name__ == "__main__":
    main()
