"""Branches of random systems of twelve kinds, each checked by a second program that shares no code with chilopod.

``python torture/branches.py --count N --seed S --kinds forced,hybrid`` prints a table by kind, and for each fault the
line that repeats it. A branch depends on its seed, kind and number alone. With ``--kept FILE`` what was found is kept
there, a line for each branch, and branches that stand in it are not followed again.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from branch_checks import checked
from branch_kinds import KINDS, Drawn, drawn
from in_process import Place
from outcomes import FoundFault, Kind, Outcome
from own_flow import Surface, guard

RESULTS = Path(__file__).with_name("branches.json")
_FAULTS = ("not closed", "multipliers", "period", "not there", "off", "kind", "missed", "end", "raised")
_COLUMNS = (
    "branches",
    "no start",
    "refused",
    "orbits",
    "confirmed",
    "not there",
    "missed",
    "other faults",
    "gaps",
    "own failures",
)
_DRAWS = 4  # until there is a branch, and one that leaves another where that is asked for
_FIRST: dict[str, Any] = {"points": 15, "budget": 20_000}  # of the branch that another one leaves


class Branches:
    """One branch, followed and checked."""

    name = "followed-branches"
    per_minute = 15

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One branch of some kind."""
        kind = chance.choice(tuple(KINDS))
        found = followed(kind, chance)
        place.tried.write_text(f"a branch of kind {kind}")
        if found["faults"]:
            raise FoundFault(Kind.WRONG, "; ".join(found["faults"][:3]))
        return Outcome(Kind.ENDED if found["counts"].get("branches") else Kind.REFUSED)


def family_of(asked: Drawn) -> Any:
    """The systems of a branch as chilopod takes them."""
    from chilopod.stability import Event, from_rhs

    system = asked.system
    rhs = system.rhs()
    events = [Event(guard(each), _reset(each), each.direction) for each in system.surfaces if each.matrix is not None]

    def family(p: float) -> Any:
        return from_rhs(
            rhs,
            system.n,
            system.period,
            args=(p,),
            events=events,
            symmetry=asked.symmetry,
            spatial_symmetry=asked.spatial,
            guess_period=asked.period,
            method="automatic" if asked.method == "taylor" else asked.method,  # type: ignore[arg-type]
        )

    return family


def _reset(surface: Surface) -> Any:
    def reset(t: Any, x: Any, p: float) -> list[Any]:
        assert surface.matrix is not None
        return [sum(weight * x[j] for j, weight in enumerate(row)) for row in surface.matrix]

    return reset


def branch_of(asked: Drawn) -> tuple[Any, bool]:
    """The branch, None where there is none to start with, and whether it is the one that is asked for.

    Raises
    ------
    ChilopodError
        As ``follow`` and ``switch`` raise it behind the start.
    """
    from chilopod.errors import AnalysisError
    from chilopod.stability import Kind as Special
    from chilopod.stability import begin, follow, locate_hopf, switch

    family = family_of(asked)
    if asked.then == "Hopf":
        try:
            located = locate_hopf(family, asked.between, asked.guess)
        except AnalysisError:
            return None, False
        born = [point for point in located if point.criticality.known]
        if not born:
            return None, False
        try:
            (start,) = switch(family, born[0])
        except AnalysisError:
            return None, False
        if not asked.between[0] <= start.value <= asked.between[1]:
            return None, False
        return follow(family, start, asked.between, **asked.options), True
    try:
        start = begin(family, asked.at, asked.guess, asked.rising, symmetric=asked.symmetric)
    except AnalysisError:
        return None, False
    if not asked.then:
        return follow(family, start, asked.between, symmetric=asked.symmetric, **asked.options), True
    wanted = Special.PERIOD_DOUBLING if asked.then == "doubling" else Special.PITCHFORK
    first = follow(family, start, asked.between, **_FIRST)
    points = [point for point in first.special_points if point.special is wanted]
    if not points:
        return first, False
    starts = switch(family, points[0])
    return follow(family, starts[0], asked.between, **asked.options), True


def followed(kind: str, chance: Random) -> dict[str, Any]:
    """What came of a branch, as plain values."""
    begun = time.monotonic()
    result: dict[str, Any] = {"faults": [], "gaps": [], "own": [], "counts": {}}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for _ in range(_DRAWS):
                asked = drawn(kind, chance)
                branch, wanted = branch_of(asked)
                if wanted:
                    break
    except Exception as error:
        name, seconds = "refused" if _is_ours(error) else "raised", time.monotonic() - begun
        said = f"{error}" if _is_ours(error) else traceback.format_exc()[-700:]
        result["gaps" if _is_ours(error) else "faults"].append(f"{name}: {said}")
        return result | {"counts": {name: 1}, "seconds": seconds}
    result["took"] = time.monotonic() - begun
    if branch is None:
        return result | {"counts": {"no start": 1}, "seconds": time.monotonic() - begun}
    with np.errstate(all="ignore"):
        try:
            found = checked(asked, branch)
        except Exception:
            result["own"].append(traceback.format_exc()[-700:])
            return result | {"counts": {"branches": 1}, "seconds": time.monotonic() - begun}
    result |= {"faults": found.faults, "gaps": found.gaps, "own": found.own}
    counts = dict(found.counts) | {"branches": 1, "special": len(branch.special_points)}
    return result | {"counts": counts, "seconds": time.monotonic() - begun}


def _is_ours(error: Exception) -> bool:
    from chilopod.errors import AnalysisError

    return isinstance(error, AnalysisError)


def case(task: tuple[int, str, int]) -> dict[str, Any]:
    """What came of one task: seed, kind, number."""
    seed, kind, number = task
    found = followed(kind, Random(f"{seed} {kind} {number}"))
    return {"seed": seed, "kind": kind, "number": number, **found}


def counted(results: Sequence[dict[str, Any]]) -> dict[str, dict[str, int]]:
    """The numbers of the table, by kind and column."""
    rows = {}
    kinds = [kind for kind in KINDS if any(each["kind"] == kind for each in results)]
    for kind in [*kinds, "all"]:
        these = [each for each in results if kind in (each["kind"], "all")]
        counts: Counter[str] = Counter()
        for each in these:
            counts.update(each["counts"])
            counts["own failures"] += len(each["own"])
        counts["other faults"] = sum(counts[name] for name in _FAULTS if name not in ("not there", "missed"))
        counts["seconds"] = round(sum(each["seconds"] for each in these))
        rows[kind] = {column: counts[column] for column in (*_COLUMNS, "seconds")}
    return rows


def table(results: Sequence[dict[str, Any]]) -> str:
    """The counts as text, a line for each kind."""
    counts = counted(results)
    rows = [["kind", *counts["all"]], *([kind, *map(str, row.values())] for kind, row in counts.items())]
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows)


def _tried(tasks: list[tuple[int, str, int]], workers: int) -> Iterator[dict[str, Any]]:
    if workers == 1:
        yield from map(case, tasks)
        return
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        yield from pool.imap_unordered(case, tasks)


def main(arguments: Sequence[str] | None = None) -> int:
    """Follow branches and check them; the exit code is 1 if there are faults."""
    asked = _parser().parse_args(arguments)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    kinds = asked.kinds.split(",") if asked.kinds else list(KINDS)
    numbers = range(asked.first, asked.first + -(-asked.count // len(kinds)))
    tasks = [(asked.seed, kind, number) for number in numbers for kind in kinds][: asked.count]
    known = (
        [json.loads(line) for line in asked.kept.read_text().splitlines()] if asked.kept and asked.kept.exists() else []
    )
    results = [each for each in known if (each["seed"], each["kind"], each["number"]) in set(tasks)]
    done = {(each["seed"], each["kind"], each["number"]) for each in results}
    tasks = [task for task in tasks if task not in done]
    try:
        for count, each in enumerate(_tried(tasks, asked.workers), 1):
            results.append(each)
            if asked.kept:
                with asked.kept.open("a") as file:
                    file.write(json.dumps(each) + "\n")
            _say(each, count, len(tasks), asked.verbose)
    except KeyboardInterrupt:
        print("interrupted; so far:")
    print(table(results))
    if asked.save:
        RESULTS.write_text(json.dumps({"kinds": counted(results)}, indent=1) + "\n", encoding="utf-8")
    return int(any(each["faults"] for each in results))


def _say(each: dict[str, Any], count: int, of: int, verbose: bool) -> None:
    again = (
        f"python torture/branches.py --seed {each['seed']} --kinds {each['kind']} --first {each['number']} --count 1"
    )
    if each["faults"] or verbose:
        print(f"{each['kind']} {each['number']}: {each['counts']}, {each['seconds']:.1f} s", flush=True)
        for name in ("faults", "gaps", "own"):
            for said in each[name][: None if verbose else 3]:
                if name == "faults" or verbose:
                    print(f"  {name}: {said}")
        print(f"  again: {again}", flush=True)
    if count % 10 == 0:
        print(f"{count} of {of}", flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=120, help="branches, kinds in turn")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--first", type=int, default=0, help="number of the first branch of each kind")
    parser.add_argument("--kinds", default="", help=f"some of {','.join(KINDS)}")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--kept", type=Path, help="file for what is found, to go on from")
    parser.add_argument("--save", action="store_true", help=f"keep the counts in {RESULTS.name}, for the docs")
    parser.add_argument("--verbose", action="store_true", help="print gaps and what this program cannot do as well")
    return parser


if __name__ == "__main__":
    sys.exit(main())
