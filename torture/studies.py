"""Small studies that are damaged, killed and disturbed, and what comes of them where nothing happens."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from in_process import Place, called, new_place

PLANAR = ("walk", "aoi2022-planar", "--duration", "0.6 s", "--rate", "20", "--seed", "1", "--repeats", "3", "--json")
TWIN = (
    *("walk", "aoi2022", "--engine", "twin", "--duration", "0.05 s", "--rate", "40", "--forces"),
    *("--seed", "1", "--repeats", "2", "--json"),
)
BRANCH = ("branch", "aoi2022-planar", "--between", "11 N*mm/deg", "13 N*mm/deg", "--json")


@dataclass(frozen=True)
class Whole:
    """What comes of a command where nothing happens to it: its output and its files."""

    command: tuple[str, ...]
    out: str
    files: dict[str, bytes]


_LARGEST = 1 << 26
_KNOWN: dict[tuple[str, ...], Whole] = {}


def whole(place: Place, *command: str, begun: Whole | None = None) -> Whole:
    """What comes of a command that writes into the folder ``kept``; it runs once a process, elsewhere.

    Parameters
    ----------
    place
        Of the case that asks.
    command
        As after ``chilopod``.
    begun
        What is in the folder before.

    Raises
    ------
    RuntimeError
        If it fails.
    """
    if command not in _KNOWN:
        elsewhere = new_place(place.root.parent / "whole")
        if begun:
            put(begun.files, elsewhere.here / "kept")
        ending = called(command, elsewhere)
        if ending.code != 0:
            raise RuntimeError(f"{' '.join(command)} fails: {ending}")
        _KNOWN[command] = Whole(command, ending.out, content(elsewhere.here / "kept"))
    return _KNOWN[command]


def put(files: dict[str, bytes], folder: Path) -> None:
    """Write files."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, each in files.items():
        (folder / name).write_bytes(each)


def content(folder: Path) -> dict[str, bytes]:
    """All regular files below a folder, but for those that are too large to be results."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.stat().st_size < _LARGEST
    }
