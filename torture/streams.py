"""Streams that are closed, full, or read by somebody who stops: files are whole, and exit codes say what was lost."""

from __future__ import annotations

import os
import subprocess
from functools import partial
from random import Random
from typing import Any

from in_process import Place, snapshot
from outcomes import Ending, FoundFault, Kind, Outcome, judged
from processes import commanded, ended, start
from studies import content, whole

_COMMANDS = {
    ("robot", "show", "aoi2022-planar"): 3,
    ("robot", "show", "aoi2022", "--json"): 2,
    ("robot", "check", "nosuch"): 2,
    ("--version",): 1,
    ("--help",): 1,
    ("robot", "new", "new.toml"): 1,
    ("stability", "aoi2022-planar", "--out", "kept"): 2,
    ("walk", "aoi2022-planar", "--duration", "1 s", "--seed", "1", "--repeats", "2", "--trials", "kept"): 2,
    ("walk", "aoi2022-planar", "--duration", "1 s", "--out", "x.nc"): 1,
    ("branch", "aoi2022-planar", "--between", "11 N*mm/deg", "13 N*mm/deg", "--points", "2", "--out", "kept"): 1,
}
_STATES = ("good", "closed", "full", "stopped")


class Streams:
    """A command with stdin, stdout and stderr in any state."""

    name = "streams"
    per_minute = 40

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One command."""
        (command,) = chance.choices(tuple(_COMMANDS), tuple(_COMMANDS.values()))
        out, err = chance.choice(_STATES), chance.choice(_STATES[:3])
        closed_in = chance.random() < 0.2
        place.tried.write_text(
            f"chilopod {' '.join(command)} with stdout {out}, stderr {err}, stdin closed: {closed_in}"
        )
        study = whole(place, *command, by=commanded)
        right, files = study.ending, study.files
        before = snapshot(place.root)
        ending = _with_streams(command, place, out, err, closed_in)
        after = snapshot(place.root)
        if "Traceback" in ending.err + ending.out or "Exception ignored" in ending.err:
            raise FoundFault(Kind.TRACEBACK, ending.err[-300:])
        if ending.code is not None and ending.code < 0:
            raise FoundFault(Kind.CRASH, f"signal {-ending.code}")
        now = content(place.here)
        if any(each != files.get(name) for name, each in now.items()):
            raise FoundFault(Kind.LEFT, "a file is another")
        lost = out in ("closed", "full") and bool(right.out)
        if not lost and ending.code != right.code and out != "stopped":
            raise FoundFault(Kind.CODE, f"exit code {ending.code} instead of {right.code}: {ending.err[-200:]}")
        if lost and right.code == 0 and ending.code != 2:
            raise FoundFault(Kind.CODE, f"exit code {ending.code}, though nobody has the result: {ending.err[-200:]}")
        if out == "good" and ending.out != right.out:
            raise FoundFault(Kind.WRONG, f"on stdout {ending.out[-200:]!r} instead of {right.out[-200:]!r}")
        if right.code == 0 and now != files:
            raise FoundFault(Kind.REPEATED, f"{', '.join({*files} - {*now})} is not there: {ending.err[-200:]}")
        if err == "good" and ending.code == 2:
            return Outcome(judged(ending, before, after, named=["stdout", *command], stays=False), ending.err[-200:])
        return Outcome(Kind.ENDED)


def _with_streams(command: tuple[str, ...], place: Place, out: str, err: str, closed_in: bool) -> Ending:
    handles = {1: _handle(out, place.out), 2: _handle(err, place.err)}
    closed = [number for number, state in ((0, closed_in), (1, out == "closed"), (2, err == "closed")) if state]
    options: dict[str, Any] = {"stdout": handles[1], "stderr": handles[2], "preexec_fn": partial(_close, closed)}
    process = start(command, place, **options)
    for handle in handles.values():
        if handle >= 0:
            os.close(handle)
    if process.stdout is not None:
        process.stdout.read(10)
        process.stdout.close()
    code = ended(process)
    texts = [path.read_text(errors="replace") if path.exists() else "" for path in (place.out, place.err)]
    return Ending(code, *texts)


def _handle(state: str, path: Any) -> int:
    if state == "stopped":
        return subprocess.PIPE
    if state == "full" and os.path.exists("/dev/full"):
        return os.open("/dev/full", os.O_WRONLY)
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)


def _close(numbers: list[int]) -> None:
    for number in numbers:
        os.close(number)
