"""Contents of a folder of trials, from its names and the headers of its files, without building robots or walking."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from chilopod.engine import ENGINES
from chilopod.errors import OutputError, ParameterError
from chilopod.netcdf import UnsoundError
from chilopod.progress import Progress, silent
from chilopod.trials.claims import nobody_in
from chilopod.trials.store import read_header
from chilopod.trials.trial import digest_of, versions_of

_TRIAL = re.compile(r".+-[0-9a-f]{20}\.nc")
_ASIDE = re.compile(_TRIAL.pattern + r"\.aside\d*")
_UNFINISHED = ".chilopod-"
_EVERY = 50  # files between two reports of progress

Wrong = list[tuple[Path, str]]  # fault of each


class Contents(NamedTuple):
    """Names in a folder: records of trials, files set aside, unfinished files of running or killed processes, and files
    that are none of these."""

    trials: tuple[Path, ...]
    aside: tuple[Path, ...]
    unfinished: tuple[Path, ...]
    foreign: tuple[Path, ...]


class Kept(NamedTuple):
    """A kept trial from the header of its file: path and size of the file (bytes), name of the robot, and
    :attr:`chilopod.trials.Trial.text`. It is ``current`` if this version of chilopod and of the engine would use the
    file; the version of a user's engine is not checked."""

    path: Path
    size: int
    robot: str
    settings: dict[str, Any]
    current: bool


def contents(folder: Path) -> Contents:
    """Return the names in a folder, in order. Raises ParameterError if the folder is missing or cannot be read."""
    trials, aside, unfinished, foreign = found = [list[Path]() for _ in range(4)]
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                file, paths = entry.is_file(follow_symlinks=False), foreign
                if _TRIAL.fullmatch(entry.name):
                    paths = trials
                elif file and _ASIDE.fullmatch(entry.name):
                    paths = aside
                elif file and entry.name.startswith(_UNFINISHED):
                    paths = unfinished
                paths.append(folder / entry.name)
    except OSError as error:
        raise ParameterError(f"must be a trial folder ({error.strerror})", field="folder", value=str(folder)) from None
    return Contents(*(tuple(sorted(each)) for each in found))


def kept(paths: Sequence[Path], progress: Progress = silent) -> tuple[list[Kept], Wrong]:
    """Return the headers of readable files, and the faults of the others."""
    return _looked_at(paths, False, progress)


def checked(paths: Sequence[Path], progress: Progress = silent) -> tuple[list[Kept], Wrong]:
    """Return the same for files that are complete to the last byte and named after their trial."""
    return _looked_at(paths, True, progress)


def clean(folder: Path, *, old: bool = False, dry: bool = False) -> tuple[list[Path], Wrong]:
    """Remove files of chilopod that are not records: files set aside, and unfinished files of killed processes.

    ``old`` also removes the records of other versions; ``dry`` removes nothing. Returns the files that were (or would
    be) removed, and the files kept with the reason. Raises OutputError if a file cannot be removed.
    """
    found = contents(folder)
    remove = list(found.aside)
    left = [(path, "not a trial") for path in found.foreign]
    if nobody_in(folder):
        remove += found.unfinished
    else:
        left += [(path, "a process is walking here") for path in found.unfinished]
    if old:
        remove += [each.path for each in kept(found.trials)[0] if not each.current and not each.path.is_symlink()]
    for path in () if dry else remove:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(f"cannot be removed ({error.strerror})", source=str(path)) from None
    return remove, left


@dataclass(frozen=True)
class Group:
    """Trials of robots of one name that differ only in the robots' numbers, their seeds, and the targets of a course:
    shared settings, number of robots, seeds of disturbed trials, number of trials, and size of all files, bytes. The
    code is the digest of the code of a user's controller, else empty. The target is bearing, rad, and distance, m, or
    the number of targets of a course."""

    robot: str
    engine: str
    controller: str | None
    code: str
    duration: float
    target: tuple[float, float] | int | None
    current: bool
    robots: int
    seeds: tuple[int, ...]
    count: int
    size: int


def groups(trials: Sequence[Kept]) -> list[Group]:
    """Group trials, in order of their names."""
    alike: dict[tuple[Any, ...], list[Kept]] = {}
    for each in trials:
        # Other versions may have other fields.
        controller, target = each.settings.get("controller"), each.settings.get("target")
        name = str(controller.get("class", "")).partition(" ")[0] if isinstance(controller, dict) else None
        if isinstance(target, dict):
            target = len(target.get("goals", ()))
        goal = tuple(target) if isinstance(target, list) else target
        code = each.settings.get("code", "")
        shared = each.robot, each.settings["engine"], name, code, each.settings["duration"], goal, each.current
        alike.setdefault(shared, []).append(each)
    found = []
    for shared, group in alike.items():
        texts = [each.settings for each in group]
        robots = len({each.get("robot") for each in texts})
        seeds = sorted({each["seed"] for each in texts if any(each.get("disturbance", {}).values())})
        found.append(Group(*shared, robots, tuple(seeds), len(group), sum(each.size for each in group)))
    return sorted(found, key=lambda group: (group.robot, group.engine, repr(group)))


def _looked_at(paths: Sequence[Path], whole: bool, progress: Progress) -> tuple[list[Kept], Wrong]:
    found: list[Kept] = []
    wrong: Wrong = []
    for index, path in enumerate(paths):
        if index % _EVERY == 0:
            progress(index / len(paths), f"{index} of {len(paths)} trials")
        with suppress(FileNotFoundError):  # another process was faster
            try:
                found.append(_kept(path, *read_header(path, whole=whole)))
            except UnsoundError as error:
                wrong.append((path, str(error)))
    if paths:
        progress(1.0, f"{len(paths)} trials")
    return found, wrong


def _kept(path: Path, attributes: dict[str, str], size: int) -> Kept:
    text = attributes.get("trial", "")
    digest = digest_of(text)
    if not path.stem.endswith(f"-{digest}"):
        other = f"holds another trial, whose name ends in {digest}.nc"
        raise UnsoundError(other if text else "is not the record of a trial")
    try:
        settings = json.loads(text)
        # TOML begins with what stands in no section.
        robot = tomllib.loads(attributes["robot"].partition("\n[")[0])["name"]
        ours = settings["engine"] in ENGINES
        here = versions_of(settings["engine"] if ours else ENGINES[0])
        current = all(settings.get(name) == here[name] for name in here if ours or name != "engine_version")
    except (LookupError, TypeError, ValueError, AttributeError):
        raise UnsoundError("is damaged or was edited") from None
    return Kept(path, size, robot, settings, current)
