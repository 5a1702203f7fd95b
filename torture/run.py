"""Attacks chilopod in every way that is known here, and counts what came of it: ``make torture``.

``python torture/run.py [CLASS ...] --seed N --minutes M``; a fault is repeated by the line printed with it. The same
seed makes the same attacks, by however many processes.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from arguments import Arguments
from branches import Branches
from broken_engines import BrokenEngines
from disks import Disks
from edited_controllers import EditedControllers
from environments import Environments
from invariances import Invariances
from kills import KillChains, Kills
from known_constants import KnownConstants
from live_clients import LiveClients
from outcomes import FINE, SENTENCES, Kind
from processors import Processors
from robot_files import RobotFiles
from same_bits import SameBits
from saved_branches import SavedBranches
from saved_trials import SavedTrials
from streams import Streams
from verbs import Verbs
from workers import Attacks, tried

RESULTS = Path(__file__).with_name("results.json")
_KINDS = (
    *(RobotFiles, Arguments, SavedTrials, SavedBranches, Kills, KillChains, Disks, Streams, Environments),
    *(SameBits, Verbs, Invariances, Processors, LiveClients, EditedControllers, BrokenEngines, Branches),
    KnownConstants,
)
CLASSES: dict[str, Callable[[], Attacks]] = {each.name: each for each in _KINDS}
_SHOWN = 12  # different faults of a class that are printed
_BETWEEN = 5.0  # s between two lines of progress


@dataclass
class Counts:
    """What came of a class of attacks."""

    kinds: Counter[Kind] = field(default_factory=Counter)
    faults: dict[str, list[int]] = field(default_factory=dict)
    slowest: tuple[float, int] = (0.0, -1)
    seconds: float = 0.0

    @property
    def tried(self) -> int:
        """All."""
        return sum(self.kinds.values())

    @property
    def found(self) -> int:
        """Those that got through."""
        return sum(count for kind, count in self.kinds.items() if kind not in FINE)


def main(arguments: Sequence[str] | None = None) -> int:
    """Attack; the exit code is 1 if anything got through."""
    asked = _parser().parse_args(arguments)
    counts: dict[str, Counts] = {}
    folder = Path(tempfile.mkdtemp(prefix="torture-"))
    names = asked.classes or list(CLASSES)
    print(f"seed {asked.seed}, {asked.processes} processes, in {folder}", flush=True)
    try:
        for name in names:
            inner = folder / name
            inner.mkdir()
            counts[name] = _attacked(name, asked, asked.minutes / len(names), inner)
            shutil.rmtree(inner, ignore_errors=True)
    except KeyboardInterrupt:
        print("interrupted; so far:")
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(table(counts))
    if asked.save:
        RESULTS.write_text(json.dumps(kept_with(counts, asked.seed), indent=1) + "\n", encoding="utf-8")
    return int(any(each.found for each in counts.values()))


def _attacked(name: str, asked: argparse.Namespace, minutes: float, folder: Path) -> Counts:
    make = CLASSES[name]
    count = asked.count or max(1, round(make.per_minute * minutes))
    first = 0 if asked.case is None else asked.case
    cases = range(first, first + (count if asked.case is None else 1))
    until = time.monotonic() + 120.0 * minutes if asked.count is None else float("inf")
    found, begun, last = Counts(), time.monotonic(), 0.0

    def in_time() -> Iterator[int]:
        for case in cases:
            if time.monotonic() > until:
                return
            yield case

    def show() -> None:
        rate = found.tried / max(found.seconds, 1e-9) * 60.0
        print(f"{name}: {found.tried} of {len(cases)}, {found.found} faults, {rate:.0f} a minute", flush=True)

    for each in tried(make, asked.seed, in_time(), min(asked.processes, len(cases)), folder):
        kind, said = each.outcome.kind, each.outcome.said
        found.kinds[kind] += 1
        found.seconds = time.monotonic() - begun
        found.slowest = max(found.slowest, (each.seconds, each.case))
        if kind not in FINE:
            # Faults that differ in numbers and names only are one.
            alike = f"{kind.value}: {re.sub(r'[0-9.]+|/[^ ]*', '#', said)[:70]}"
            repeated = found.faults.setdefault(alike, [])
            repeated.append(each.case)
            if (len(repeated) == 1 and len(found.faults) <= _SHOWN) or asked.all:
                print(
                    f"{name}: {kind.value}: {each.words}\n  {said}\n  again: {again(name, asked.seed, each.case)}",
                    flush=True,
                )
        if asked.case is not None:
            print(f"{kind.value}: {each.words}\n{said}")
        elif time.monotonic() - last > _BETWEEN:
            last = time.monotonic()
            show()
    show()
    for alike, repeated in sorted(found.faults.items(), key=lambda item: -len(item[1])):
        print(f"  {len(repeated)} x {alike}: case {', '.join(map(str, repeated[:5]))}")
    print(f"  slowest: case {found.slowest[1]}, {found.slowest[0]:.1f} s", flush=True)
    return found


def again(name: str, seed: int, case: int) -> str:
    """The line that repeats a case."""
    return f"python torture/run.py {name} --seed {seed} --case {case}"


def table(counts: dict[str, Counts]) -> str:
    """What came of all classes, as text."""
    kinds = list(Kind)
    rows = [["class", "tried", *(kind.value for kind in kinds)]]
    rows += [[name, str(each.tried), *(str(each.kinds[kind]) for kind in kinds)] for name, each in counts.items()]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    return "\n".join([*lines, *(f"{kind.value}: {SENTENCES[kind]}" for kind in kinds)])


def kept_with(counts: dict[str, Counts], seed: int) -> dict[str, object]:
    """Counts as plain numbers, with those that are kept of the other classes; of each class its last run."""
    kept = json.loads(RESULTS.read_text(encoding="utf-8"))["classes"] if RESULTS.exists() else {}
    kept |= {
        name: {
            "seed": seed,
            "tried": each.tried,
            **{kind.value: each.kinds[kind] for kind in FINE},
            "faults": each.found,
            "seconds": round(each.seconds),
        }
        for name, each in counts.items()
    }
    classes = {name: kept[name] for name in CLASSES if name in kept}
    return {
        "classes": classes,
        "tried": sum(each["tried"] for each in classes.values()),
        "faults": sum(each["faults"] for each in classes.values()),
    }


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("classes", nargs="*", metavar="CLASS", choices=[*CLASSES, []], help=f"of {', '.join(CLASSES)}")
    parser.add_argument("--seed", type=int, default=int(time.time()) % 100_000, help="of all attacks")
    parser.add_argument("--minutes", type=float, default=10.0, help="about, on two cores, for all classes together")
    parser.add_argument("--count", type=int, help="attacks of every class, however long they take")
    parser.add_argument("--case", type=int, help="one attack only")
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--all", action="store_true", help="print every fault, not one of each kind")
    parser.add_argument("--save", action="store_true", help=f"keep the counts in {RESULTS.name}, for the docs")
    return parser


if __name__ == "__main__":
    sys.exit(main())
