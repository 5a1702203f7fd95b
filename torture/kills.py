"""Studies that are killed at any moment, and asked for again: nothing lost, nothing walked twice that was kept."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import time
from random import Random

import xarray as xr

from in_process import Place, snapshot
from outcomes import Ending, FoundFault, Kind, Outcome, is_temporary, judged
from processes import commanded
from studies import content, whole

_PLANAR = ("walk", "aoi2022-planar", "--duration", "20 s", "--rate", "50", "--seed", "1", "--repeats", "150", "--json")
_TWIN = ("walk", "aoi2022", "--engine", "twin", "--duration", "0.6 s", "--seed", "1", "--repeats", "12", "--json")
_KEPT = ("--trials", "kept")
STUDIES = {
    (*_PLANAR, *_KEPT, "--out", "x.nc"): 4,
    (*_TWIN, *_KEPT): 3,
    (*_PLANAR, *_KEPT, "--cluster", "2"): 2,
    (*_TWIN, *_KEPT, "--cluster", "2"): 1,
}
_SIGNALS = {signal.SIGKILL: 5, signal.SIGINT: 3, signal.SIGTERM: 2}


class Kills:
    """A study of several batches; a signal; the study again."""

    name = "kills"
    per_minute = 5

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One kill, at any moment from the start of the process on."""
        (study,) = chance.choices(tuple(STUDIES), tuple(STUDIES.values()))
        (number,) = chance.choices(tuple(_SIGNALS), tuple(_SIGNALS.values()))
        part = chance.random()
        place.tried.write_text(f"chilopod {' '.join(study)}; {number.name} after {part:.3f} of its time")
        right = whole(place, *study, by=commanded)

        def kill(process: subprocess.Popen[bytes]) -> None:
            time.sleep(part * right.seconds)
            if number is signal.SIGKILL:
                os.killpg(process.pid, number)
            else:
                process.send_signal(number)

        first = commanded(study, place, kill)
        _stopped(first, number, place)
        before, kept = snapshot(place.here / "kept"), content(place.here / "kept")
        wrong = [name for name, each in kept.items() if not is_temporary(name) and each != right.kept.get(name)]
        if wrong:
            raise FoundFault(Kind.LEFT, f"{wrong[0]} is not whole after {number.name}")
        second = commanded((*study, "--force"), place)
        judged(second, {}, {name: 0 for name in snapshot(place.root) if not name.startswith("tmp/")})
        if second.code != 0 or second.out != right.ending.out:
            raise FoundFault(Kind.WRONG, f"another result after {number.name}: {second.err[-200:]}")
        now = {name: each for name, each in content(place.here).items()}
        for name, each in right.files.items():
            if not _same(name, now.get(name), each):
                raise FoundFault(Kind.WRONG, f"{name} is another after {number.name}")
        after = snapshot(place.here / "kept")
        twice = [name for name in kept if not is_temporary(name) and before[name] != after[name]]
        if twice:
            raise FoundFault(Kind.REPEATED, f"{len(twice)} of {len(kept)} files are new, such as {twice[0]}")
        beside = {*now} - {*right.files}
        if beside:
            raise FoundFault(Kind.LEFT, f"{', '.join(sorted(beside))} after {number.name}")
        return Outcome(Kind.ENDED, f"{len(kept)} of {len(right.files)} files were kept")


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
