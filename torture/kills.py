"""Studies that are killed at any moment, and asked for again: seconds are lost, and nothing is walked twice."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import time
from functools import partial
from random import Random

import xarray as xr

from in_process import Place, snapshot
from outcomes import Ending, FoundFault, Kind, Outcome, is_temporary, judged
from processes import commanded
from studies import Whole, content, put, whole

_PLANAR = ("walk", "aoi2022-planar", "--seed", "1", "--json")
_SHORT = (*_PLANAR, "--duration", "200 s", "--rate", "2", "--repeats", "600")
_LONG = (*_PLANAR, "--duration", "3000 s", "--rate", "0.2", "--repeats", "40")
_TWIN = ("walk", "aoi2022", "--engine", "twin", "--seed", "1", "--json", "--duration", "10 s", "--repeats", "150")
_KEPT = ("--trials", "kept")
STUDIES = {
    (*_SHORT, *_KEPT, "--out", "x.nc"): 3,
    (*_LONG, *_KEPT): 3,
    (*_TWIN, *_KEPT): 3,
    (*_SHORT, *_KEPT, "--cluster", "2"): 1,
    (*_TWIN, *_KEPT, "--cluster", "2"): 1,
}
"""About a minute each, and how often each is chosen."""
MOMENTS = 2.0, 12.0
"""s after its start at which a study is killed."""
CHAINED = 8.0, 12.0
"""The same, where it is interrupted again and again."""
LOST = 5.0
"""s of work that may be lost."""
_LONGER = 5  # times as many trials, where it is interrupted again and again
_LEFT = 3  # trials that are missing when it is asked again to the end
_SIGNALS = {signal.SIGKILL: 5, signal.SIGINT: 3, signal.SIGTERM: 2}
_PATIENCE = 600.0  # s
_by = partial(commanded, limit=_PATIENCE)


class Kills:
    """A study of a minute, a part of it there already; a signal; the study again, but for a few trials put there."""

    name = "kills"
    per_minute = 5

    def __init__(self, studies: dict[tuple[str, ...], int] | None = None) -> None:
        self._studies = studies or STUDIES

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One kill, at any moment from the start of the process on."""
        (study,) = chance.choices(tuple(self._studies), tuple(self._studies.values()))
        (number,) = chance.choices(tuple(_SIGNALS), tuple(_SIGNALS.values()))
        moment, part = chance.uniform(*MOMENTS), chance.uniform(0.0, 0.8)
        right = whole(place, *study, by=_by)
        names = sorted(right.kept)
        had = set(chance.sample(names, int(part * len(names))))
        put({f"kept/{name}": right.kept[name] for name in had}, place.here)
        words = f"chilopod {' '.join(study)}; {number.name} after {moment:.1f} s, {len(had)} of {len(names)} there"
        place.tried.write_text(words)
        begun = time.time()
        _, killed = _interrupted(study, number, moment, place)
        new = _whole_ones(right, place, number) - had
        written = [(place.here / "kept" / name).stat().st_mtime for name in new]
        again = self._again(study, number, place, chance)
        # Until the first trial is there, the process starts, and has no more to do for that than when nothing is left.
        lost = max(0.0, killed - (max(written) if written else begun + again))
        if killed and lost > LOST:
            raise FoundFault(Kind.REPEATED, f"{lost:.1f} s of work lost, {len(new)} new after {moment:.1f} s")
        return Outcome(Kind.ENDED, f"{len(new)} new after {moment:.1f} s, {lost:.1f} s lost")

    def _again(self, study: tuple[str, ...], number: signal.Signals, place: Place, chance: Random) -> float:
        """Ask again for a study of which all but a few trials are there: its result, its files, its time."""
        right = whole(place, *study, by=_by)
        there = {name for name in content(place.here / "kept") if not is_temporary(name)}
        missing = sorted(right.kept.keys() - there)
        left = chance.sample(missing, min(_LEFT, len(missing)))
        put({f"kept/{name}": right.kept[name] for name in missing if name not in left}, place.here)
        before, start = snapshot(place.here / "kept"), time.monotonic()
        second = _by((*study, "--force"), place)
        seconds = time.monotonic() - start
        judged(second, {}, {name: 0 for name in snapshot(place.root) if not name.startswith("tmp/")})
        if second.code != 0 or second.out != right.ending.out:
            raise FoundFault(Kind.WRONG, f"another result after {number.name}: {second.err[-200:]}")
        after = snapshot(place.here / "kept")
        twice = [name for name in right.kept if name not in left and before[name] != after[name]]
        if twice:
            raise FoundFault(Kind.REPEATED, f"{len(twice)} files are new, such as {twice[0]}")
        _all_there(right, place, number)
        return seconds


class KillChains(Kills):
    """A study from its beginning, interrupted every ten seconds and asked for again, until it ends: it gets on."""

    name = "kill-chains"
    per_minute = 1

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One study."""
        (study,) = chance.choices(tuple(self._studies), tuple(self._studies.values()))
        at = study.index("--repeats") + 1
        study = (*study[:at], str(_LONGER * int(study[at])), *study[at + 1 :])
        right = whole(place, *study, by=_by)
        place.tried.write_text(f"chilopod {' '.join(study)}; again and again")
        had, kills, worst = set[str](), 0, 0.0
        while True:
            (number,) = chance.choices(tuple(_SIGNALS), tuple(_SIGNALS.values()))
            ending, killed = _interrupted((*study, "--force"), number, chance.uniform(*CHAINED), place)
            now = _whole_ones(right, place, number)
            if ending.code == 0:
                break
            if now <= had < right.kept.keys():
                raise FoundFault(Kind.REPEATED, f"no new trial beside {len(had)}, {number.name} number {kills + 1}")
            written = [(place.here / "kept" / name).stat().st_mtime for name in now - had]
            lost = killed - max(written, default=killed)
            if lost > LOST:
                raise FoundFault(Kind.REPEATED, f"{lost:.1f} s of work lost, {number.name} number {kills + 1}")
            had, kills, worst = now, kills + 1, max(worst, lost)
        if ending.out != right.ending.out:
            raise FoundFault(Kind.WRONG, f"another result after {kills} kills: {ending.err[-200:]}")
        _all_there(right, place, number)
        return Outcome(Kind.ENDED, f"done after {kills} kills, at most {worst:.1f} s lost at each")


def _interrupted(study: tuple[str, ...], number: signal.Signals, moment: float, place: Place) -> tuple[Ending, float]:
    """How a study ends that is sent a signal after some seconds, and when that was; 0 if it was done before."""
    killed = [0.0]

    def kill(process: subprocess.Popen[bytes]) -> None:
        try:
            process.wait(moment)
        except subprocess.TimeoutExpired:
            killed[0] = time.time()
            if number is signal.SIGKILL:
                os.killpg(process.pid, number)
            else:
                process.send_signal(number)

    ending = _by(study, place, kill)
    _stopped(ending, number, place)
    return ending, killed[0]


def _whole_ones(right: Whole, place: Place, number: signal.Signals) -> set[str]:
    """Names of the trials that are there; each is the right one."""
    kept = {name: each for name, each in content(place.here / "kept").items() if not is_temporary(name)}
    wrong = [name for name, each in kept.items() if each != right.kept.get(name)]
    if wrong:
        raise FoundFault(Kind.LEFT, f"{wrong[0]} is not whole after {number.name}")
    return {*kept}


def _all_there(right: Whole, place: Place, number: signal.Signals) -> None:
    """Make sure that the files are those that should be there, and no others."""
    now = content(place.here)
    for name, each in right.files.items():
        if not _same(name, now.get(name), each):
            raise FoundFault(Kind.WRONG, f"{name} is another after {number.name}")
    beside = {*now} - {*right.files}
    if beside:
        raise FoundFault(Kind.LEFT, f"{', '.join(sorted(beside))} after {number.name}")


def _same(name: str, now: bytes | None, right: bytes) -> bool:
    """Trials have the same bytes, a record of many walks the same data, in the order in which they came."""
    if now is None or name.startswith("kept/"):
        return now == right
    one, other = (xr.load_dataset(io.BytesIO(each), engine="h5netcdf") for each in (now, right))
    types = [{key: variable.dtype for key, variable in each.variables.items()} for each in (one, other)]
    return one.identical(other) and types[0] == types[1]


def _stopped(ending: Ending, number: signal.Signals, place: Place) -> None:
    """Make sure that a command that was sent a signal ended as it should; it may have been done before."""
    after = snapshot(place.root)
    if number is signal.SIGINT:
        judged(ending, {}, after, codes=(0,), interrupted=True)
    elif ending.code not in (0, -number, 128 + number):
        raise FoundFault(Kind.CODE, f"exit code {ending.code} after {number.name}: {ending.err[-200:]}")
    elif "Traceback" in ending.err:
        raise FoundFault(Kind.TRACEBACK, f"after {number.name}: {ending.err[-200:]}")
    elif number is signal.SIGTERM and any(map(is_temporary, after)):
        raise FoundFault(Kind.LEFT, f"{next(filter(is_temporary, after))} after {number.name}")
