"""Small studies that are damaged, killed and disturbed, and what comes of them where nothing happens."""

from __future__ import annotations

import hashlib
import pickle
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from chilopod.output import write_atomic
from chilopod.process import INTERRUPTED
from in_process import Place, called, new_place
from outcomes import Ending

PLANAR = ("walk", "aoi2022-planar", "--duration", "0.6 s", "--rate", "20", "--seed", "1", "--repeats", "3", "--json")
TWIN = (
    *("walk", "aoi2022", "--engine", "twin", "--duration", "0.05 s", "--rate", "40", "--forces"),
    *("--seed", "1", "--repeats", "2", "--json"),
)
BRANCH = ("branch", "aoi2022-planar", "--between", "11 N*mm/deg", "13 N*mm/deg", "--json")
_LARGEST = 1 << 26  # bytes of a result


@dataclass(frozen=True)
class Whole:
    """What comes of a command where nothing happens to it: its ending, its files, and how long it takes, s."""

    command: tuple[str, ...]
    ending: Ending
    files: dict[str, bytes]
    seconds: float

    @property
    def kept(self) -> dict[str, bytes]:
        """The files in the folder ``kept``."""
        return {name.removeprefix("kept/"): each for name, each in self.files.items() if name.startswith("kept/")}


_KNOWN: dict[tuple[str, ...], Whole] = {}


def whole(
    place: Place, *command: str, by: Callable[[tuple[str, ...], Place], Ending] = called, begun: Whole | None = None
) -> Whole:
    """What comes of a command; it runs once, elsewhere.

    Parameters
    ----------
    place
        Of the case that asks.
    command
        As after ``chilopod``.
    by
        What calls it.
    begun
        Whose files are there before.
    """
    if command not in _KNOWN:
        file = place.out.parent.parent / f"whole-{hashlib.sha256(repr(command).encode()).hexdigest()[:16]}"
        if file.exists():
            _KNOWN[command] = pickle.loads(file.read_bytes())
        else:
            elsewhere = new_place(place.out.parent / "whole")
            put(begun.files if begun else {}, elsewhere.here)
            start = time.monotonic()
            ending = by(command, elsewhere)
            if ending.code == INTERRUPTED:
                raise RuntimeError("what is right is not known: the machine is too busy")
            _KNOWN[command] = Whole(command, ending, content(elsewhere.here), time.monotonic() - start)
            write_atomic(file, pickle.dumps(_KNOWN[command]))
    return _KNOWN[command]


def put(files: dict[str, bytes], folder: Path) -> None:
    """Write files."""
    for name, each in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(each)


def content(folder: Path) -> dict[str, bytes]:
    """All regular files below a folder, but for those that are too large to be results."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.stat().st_size < _LARGEST
    }
