"""Growth rates over two springs, by chilopod beside other tools in the same run, and a map with its curves.

Run by `make bench`; rewrites the table in README.md. Time is that of one core: CPU time over the number of rates. Each
peer computes the half-period map at a tolerance of 1e-10 and takes its eigenvalues; preparing and compiling is not
timed. chilopod computes to round-off, with a bound.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import itertools
import time
from collections.abc import Callable, Sequence

import numpy as np

from chilopod.analysis import map as mapped
from chilopod.analysis.growth import growth_rates
from chilopod.cores import use_at_most
from chilopod.robot import load_robot

from _timing import duration, machine, table, write_section
from peer_model import N_MM_PER_DEG, PeerRobot, mirror
from peers import available

ROBOT = load_robot("aoi2022-planar")
PEER = PeerRobot()
FIRST, OTHERS = np.linspace(5.0, 75.0, 100) * N_MM_PER_DEG, np.linspace(10.0, 75.0, 100) * N_MM_PER_DEG
SAMPLE = 30  # rates of a peer


def cpu_seconds(call: Callable[[], object]) -> float:
    call()
    begun = time.process_time()
    call()
    return time.process_time() - begun


def ours() -> np.ndarray:
    lines = (ROBOT.with_value("springs.stiffness[1:]", others) for others in OTHERS)
    robots = (line.with_value("springs.stiffness[0]", first) for line in lines for first in FIRST)
    return growth_rates(robots, FIRST.size * OTHERS.size).growth


def main() -> None:
    here = machine()
    use_at_most(1)  # as the peers
    pairs = list(itertools.product(OTHERS, FIRST))
    chosen = np.linspace(0, len(pairs) - 1, SAMPLE).astype(int)
    exact = ours()[chosen]
    each = cpu_seconds(ours) / len(pairs)
    rows: list[Sequence[str]] = [("chilopod", duration(each), f"{1e6 * each:.0f} s", "1", "")]
    for name, prepare in available().items():
        compute = prepare(PEER, 0.5, 1e-10)

        def rates(compute: Callable[[Sequence[float]], np.ndarray] = compute) -> np.ndarray:
            found = [compute((pairs[at][1], *[pairs[at][0]] * 4)) for at in chosen]
            moduli = [np.abs(np.linalg.eigvals(mirror(PEER) @ each)).max() for each in found]
            return 2.0 * np.log(moduli) / PEER.period

        seconds = cpu_seconds(rates) / SAMPLE
        wrong = np.abs(rates() - exact).max()
        rows.append((name, duration(seconds), f"{1e6 * seconds:.0f} s", f"{seconds / each:.3g}", f"{wrong:.0e}"))
    axes = ("springs.stiffness[0]", "5 N*mm/deg", "75 N*mm/deg"), ("legs.forward_offset", "0 mm", "60 mm")
    whole = cpu_seconds(lambda: mapped(ROBOT, *axes, points=200))
    head = ("growth rates of 6 modules", "one", "a million", "in those of chilopod", "apart (1/s)")
    text = f"{here}\n\n{table(head, rows)}\n\nA map of 200 x 200 values with its pitchfork curve: {duration(whole)}."
    write_section("maps", text)


if __name__ == "__main__":
    main()
