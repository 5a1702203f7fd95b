"""Trials that were kept and then damaged: each is noticed, set aside and walked again, with equal numbers."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from random import Random

import xarray as xr

from damages import SPARSE, edited, on_bytes, replaced
from in_process import Place, called, snapshot
from outcomes import FoundFault, Kind, Outcome, judged
from studies import PLANAR, TWIN, content, put, whole


class SavedTrials:
    """One or two files of a small study, planar or twin; then the study is asked for again."""

    name = "trials"
    per_minute = 700

    def __init__(self, quick: bool = False) -> None:
        self._studies = {PLANAR: 9} if quick else {PLANAR: 9, TWIN: 1}

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One damage."""
        study = whole(
            place, *chance.choices(tuple(self._studies), tuple(self._studies.values()))[0], "--trials", "kept"
        )
        folder = place.here / "kept"
        put(study.kept, folder)
        names = [name for name in study.kept if name.endswith(".nc")]
        hit = chance.sample(names, chance.choice((1, 1, 2)))
        place.tried.write_text(f"chilopod {' '.join(study.command)} with {', '.join(hit)} damaged")
        for name in hit:
            damage(folder / name, [folder / each for each in names], chance, place)
        damaged = {name: _state(folder / name) for name in names}
        touched = [name for name in names if damaged[name] != study.kept[name]]
        ending = called(study.command, place)
        after = snapshot(place.root)
        # Whatever is in the folder may have been moved aside; what is temporary may not stay.
        kind = judged(ending, {}, after, named=[*names, "kept"], interrupted=place.interrupted.exists(), stays=False)
        if kind in (Kind.REFUSED, Kind.STOPPED):  # compiling may take longer than the patience
            return Outcome(kind, ending.err.strip()[-200:])
        if ending.out != study.ending.out:
            raise FoundFault(Kind.WRONG, "another result")
        now = content(folder)
        for name in names:
            if now.get(name) != study.kept[name]:
                raise FoundFault(Kind.WRONG, f"{name} is not what was asked for, and stays")
        aside = [_state(path) for path in folder.iterdir() if path.name not in names]
        for name in touched:
            if damaged[name] not in (*aside, None):
                raise FoundFault(Kind.REPEATED, f"what was {name} is gone")
        told = ending.err.count("walked again")
        expected = sum(damaged[name] is not None for name in touched)
        if told != expected:
            raise FoundFault(Kind.LINES, f"{expected} damaged, {told} lines: {ending.err[:200]}")
        return Outcome(kind)


def damage(path: Path, others: list[Path], chance: Random, place: Place) -> None:
    """Do something to one of the files."""
    how, files = chance.randrange(10), [each for each in others if each.is_file() and each.stat().st_size < SPARSE]
    if how < 6:
        path.write_bytes(on_bytes(path.read_bytes(), chance))
    elif how == 6:
        path.write_bytes(chance.choice(files).read_bytes())
    elif how == 7:
        edited(path, chance, "scipy", _attributes)
    elif how == 8:
        replaced(path, chance, place)
    else:
        one, other = path.read_bytes(), chance.choice(files)
        path.write_bytes(other.read_bytes())
        other.write_bytes(one)


def _attributes(data: xr.Dataset) -> dict[str, object]:
    trial = str(data.attrs["trial"])
    return {
        "trial": trial.replace('"seed": ', '"seed": 1'),
        "robot": str(data.attrs["robot"]).replace("41 ", "42 ", 1),
        "checksum": "00000000",
        "engine": "another",
        "version": trial.replace('"version": 5', '"version": 4'),
    }


def _state(path: Path) -> object:
    """What is at a path, and None if there is nothing."""
    if not os.path.lexists(path):
        return None
    kind = stat.S_IFMT(os.lstat(path).st_mode)
    if stat.S_ISREG(kind):
        return path.read_bytes() if path.stat().st_size < 1 << 26 else path.stat().st_size
    return os.readlink(path) if stat.S_ISLNK(kind) else kind
