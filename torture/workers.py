"""Processes that attack, one case after the other, and the parent that watches them: who is silent, who dies."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from random import Random
from typing import Any, Protocol

from in_process import Place, new_place
from outcomes import FoundFault, Kind, Outcome

SILENT = 10.0
"""Longest time without a word, s of computing."""
WAITING = 40.0
"""The same where nothing is computed here, s."""
PATIENCE = 5.0
"""After so long, s, what says how far it is gets Ctrl-C."""
_MEMORY = 6 << 30  # bytes of address space of a process, so that none takes the whole machine's
_INTERVAL = 0.1  # s


class Attacks(Protocol):
    """One class of attacks."""

    name: str
    per_minute: int
    """About so many are tried in a minute, on two cores."""

    def attack(self, chance: Random, place: Place) -> Outcome:
        """Try one, which `chance` alone decides, in an empty place.

        Raises
        ------
        FoundFault
            If it got through.
        """
        ...


@dataclass(frozen=True)
class Tried:
    """A case and what came of it."""

    case: int
    words: str
    outcome: Outcome
    seconds: float


def attempt(attacks: Attacks, seed: int, case: int, place: Place) -> Outcome:
    """One case of a class, here."""
    try:
        return attacks.attack(Random(f"{seed} {attacks.name} {case}"), place)
    except FoundFault as fault:
        return Outcome(fault.kind, fault.said)
    except Exception:
        return Outcome(Kind.WRONG, f"the harness failed: {' | '.join(traceback.format_exc().splitlines()[-6:])}")


def work(make: Callable[[], Attacks], seed: int, home: Path, pipe: Connection) -> None:
    """What a process does: the cases that come through the pipe."""
    from chilopod.cores import use_at_most

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # but for the commands
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    use_at_most(1)
    home.mkdir()
    attacks = make()
    while (case := pipe.recv()) is not None:
        place = new_place(home)
        pipe.send("begun")
        outcome = attempt(attacks, seed, case, place)
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        pipe.send(outcome)
    pipe.send(None)


@dataclass
class _Worker:
    process: Any
    pipe: Connection
    home: Path
    case: int | None = None
    begun: float = 0.0
    said: int = -1
    heard: tuple[float, float] = (0.0, 0.0)  # wall and processor time
    interrupted: bool = False
    died: bool = field(default=False)


def tried(
    make: Callable[[], Attacks], seed: int, cases: Iterator[int], processes: int, folder: Path
) -> Iterator[Tried]:
    """What came of cases, in the order in which they end.

    Parameters
    ----------
    make
        Makes the class of attacks, in every process.
    seed
        Of all.
    cases
        Their numbers.
    processes
        At a time.
    folder
        For all their files.
    """
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):  # more would stand in each other's way
        os.environ.setdefault(name, "1")
    context, count = multiprocessing.get_context("spawn"), 0
    workers: list[_Worker] = []

    def new_worker() -> _Worker:
        nonlocal count
        count += 1
        ours, theirs = context.Pipe()
        home = folder / f"process{count}"
        process = context.Process(target=work, args=(make, seed, home, theirs), daemon=False)
        process.start()
        theirs.close()
        return _Worker(process, ours, home)

    def feed(worker: _Worker) -> None:
        worker.case = next(cases, None)
        worker.begun, worker.interrupted, worker.said = 0.0, False, -1
        with contextlib.suppress(BrokenPipeError):
            worker.pipe.send(worker.case)

    try:
        for _ in range(processes):
            workers.append(new_worker())
            feed(workers[-1])
        while workers:
            ready = wait([worker.pipe for worker in workers], _INTERVAL)
            for worker in list(workers):
                outcome = None
                if worker.pipe in ready:
                    try:
                        got = worker.pipe.recv()
                    except (EOFError, OSError):
                        worker.process.join()
                        outcome, worker.died = Outcome(Kind.CRASH, f"exit code {worker.process.exitcode}"), True
                    else:
                        if got == "begun":
                            worker.begun = time.monotonic()
                            worker.heard = worker.begun, _processor_time(worker.process.pid)
                        elif got is None:
                            workers.remove(worker)
                        else:
                            outcome = got
                            if worker.interrupted:  # its threads may go on
                                worker.process.kill()
                                worker.process.join()
                                worker.died = True
                elif worker.begun:
                    outcome = _watched(worker)
                if outcome is None:
                    continue
                if worker.case is None:
                    workers.remove(worker)
                    continue
                seconds = time.monotonic() - worker.begun if worker.begun else 0.0
                case, words = worker.case, _words(worker.home / "tried")
                if worker.died:
                    workers[workers.index(worker)] = worker = new_worker()
                feed(worker)
                yield Tried(case, words, outcome, seconds)
    finally:
        for worker in workers:
            worker.process.kill()
            worker.process.join()


def _watched(worker: _Worker) -> Outcome | None:
    """What came of a case that goes on for too long; the process is killed then."""
    now, said = time.monotonic(), _size(worker.home / "err") + _size(worker.home / "out")
    computed = _processor_time(worker.process.pid)
    if not (worker.home / "tried").exists():  # it prepares what the case is compared with
        worker.begun, worker.heard = now, (now, computed)
        return None
    if now - worker.begun < PATIENCE / 2:
        return None
    if said != worker.said:
        if worker.said >= 0 or now - worker.begun < SILENT:
            worker.heard = now, computed
        worker.said = said
    if said and not worker.interrupted and now - worker.begun > PATIENCE:
        (worker.home / "interrupted").touch()
        os.kill(worker.process.pid, signal.SIGINT)
        worker.interrupted, worker.heard = True, (now, computed)
    if computed - worker.heard[1] < SILENT and now - worker.heard[0] < WAITING:
        return None
    worker.process.kill()
    worker.process.join()
    worker.died = True
    last = (worker.home / "err").read_text(errors="replace").strip().splitlines()[-1:] if said else []
    return Outcome(Kind.SILENT, f"{'deaf to Ctrl-C' if worker.interrupted else 'silent'} {' '.join(last)[:200]}")


def _words(path: Path) -> str:
    try:
        return path.read_text(errors="replace")
    except FileNotFoundError:
        return ""


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


def _processor_time(pid: int) -> float:
    """Of a process, s; where the system does not say, the time of day."""
    try:
        numbers = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return time.monotonic()
    return (int(numbers[11]) + int(numbers[12])) / os.sysconf("SC_CLK_TCK")
