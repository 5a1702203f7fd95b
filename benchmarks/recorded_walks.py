"""How often the 90 % intervals of constants identified from recorded walks cover, by synthetic robots.

``python benchmarks/recorded_walks.py ROBOTS K1`` walks so many robots with this first spring (N*mm/deg) for 60 s. Feet
differ from the preset by factors of 0.8 to 1.25, the walk is recorded from any moment at 20 Hz, with scatter of 0.5 deg
and a tenth of the angles missing. A last argument makes the scatter of neighbouring samples alike (autocorrelation).
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from chilopod.planar import initial_states, simulate
from chilopod.robot import Robot, load_robot
from chilopod.tasks.identify import RecordedIdentification, RecordedWalks, identify_recorded

RANGES = {"ground.friction": (100.0, 500.0), "legs.half_width": (0.03, 0.15), "legs.forward_offset": (0.0, 0.1)}
SECONDS, RATE, SCATTER, MISSING = 60.0, 20, 0.5, 0.1


def recorded(seed: int, k1: float, alike: float, file: Path) -> Robot:
    """A made-up robot whose walk is in a CSV file."""
    rng, robot = np.random.default_rng(seed), load_robot("aoi2022-planar")
    robot = robot.set_from_text([f"springs.stiffness[0]={k1} N*mm/deg"])
    for path in RANGES:
        robot = robot.with_value(path, robot.get(path) * 1.25 ** rng.uniform(-1.0, 1.0))
    begin = rng.uniform(0.0, 3.0)
    walk = simulate(robot, begin + SECONDS + 1.0, initial=initial_states(robot, 0.1 * rng.normal(size=5)), rate=1000.0)
    rows = round(1000.0 * begin) + np.arange(0, round(1000 * SECONDS), 1000 // RATE)
    scatter = rng.normal(size=(rows.size, 5))
    for row in range(1, rows.size):
        scatter[row] = alike * scatter[row - 1] + np.sqrt(1.0 - alike**2) * scatter[row]
    angles = np.rad2deg(walk.joint_angle.values[rows, 0]) + SCATTER * scatter
    angles[rng.uniform(size=angles.shape) < MISSING] = np.nan
    table = np.column_stack([walk.time.values[rows], angles])
    np.savetxt(file, table, "%.4f", ",", header="time [s]" + ",joint [deg]" * 5, comments="")
    return robot


def identified(k1: float, file: Path) -> RecordedIdentification:
    """Constants of the preset's feet from the file."""
    trajectory = {"file": file.name, "settings": [f"springs.stiffness[0]={k1} N*mm/deg"]}
    data = RecordedWalks(free=RANGES, trajectory=[trajectory])
    return identify_recorded(load_robot("aoi2022-planar"), data, file.parent)


def main(robots: int, k1: float, alike: float) -> None:
    """Print each robot's errors, and counts at the end."""
    covered, off, took = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(robots):
            file = Path(folder) / f"{seed}.csv"
            robot, begin, clock = recorded(seed, k1, alike, file), time.process_time(), time.perf_counter()
            constants = identified(k1, file).as_json()["constants"]
            took.append((time.perf_counter() - clock, time.process_time() - begin))
            true = {path: robot.get(path) for path in RANGES}
            ends = {path: constants[path]["interval_si"] for path in RANGES}
            covered.append([ends[path][0] <= true[path] <= ends[path][1] for path in RANGES])
            off.append([constants[path]["value_si"] / true[path] - 1.0 for path in RANGES])
            print(
                seed,
                *(f"{100.0 * each:+.3f} %" for each in off[-1]),
                *covered[-1],
                "{:.1f} s {:.1f} s".format(*took[-1]),
                flush=True,
            )
    print("covered of", robots, dict(zip(RANGES, np.sum(covered, axis=0).tolist(), strict=True)))
    print("error, root mean square, %", (100.0 * np.sqrt(np.mean(np.square(off), axis=0))).round(3).tolist())
    print("time, median, s, and of processors:", np.median(took, axis=0).round(1).tolist())


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]) if len(sys.argv) > 3 else 0.0)
