"""Contents of a folder of trials, by its names and the headers of its files; no robot is built and nothing walks."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from chilopod.engine import ENGINES
from chilopod.errors import OutputError, ParameterError
from chilopod.netcdf import UnsoundError
from chilopod.progress import Progress, silent
from chilopod.trials.claims import nobody_in
from chilopod.trials.file import Header, read_header
from chilopod.trials.trial import digest_of, versions_of

_TRIAL = re.compile(r".+-[0-9a-f]{20}\.nc")
_ASIDE = re.compile(_TRIAL.pattern + r"\.aside\d*")
_UNFINISHED = ".chilopod-"
_EVERY = 50  # files between two signs of life


@dataclass(frozen=True)
class Contents:
    """The names in a folder, each in one of these.

    Attributes
    ----------
    trials
        Called as records of trials are.
    aside
        Files that stood in the place of a record and were none.
    unfinished
        Files that processes write, or could not finish before they were killed.
    foreign
        All else; chilopod did not write it.
    """

    trials: tuple[Path, ...]
    aside: tuple[Path, ...]
    unfinished: tuple[Path, ...]
    foreign: tuple[Path, ...]


@dataclass(frozen=True)
class Kept:
    """A trial that is kept, as its file's header says.

    Attributes
    ----------
    path
        Path of the file.
    size
        Size of the file, bytes.
    robot
        Name of the robot.
    told
        The trial's text, see :attr:`chilopod.trials.Trial.text`.
    found
        True if this version of chilopod and of the engine takes it for what it would walk; of an engine of one's own
        its version is not looked at.
    """

    path: Path
    size: int
    robot: str
    told: dict[str, Any]
    found: bool


def contents(folder: Path) -> Contents:
    """The names in a folder, in order.

    Raises
    ------
    ParameterError
        If there is no such folder, or it cannot be read.
    """
    trials, aside, unfinished, foreign = [], [], [], []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                own = entry.is_file(follow_symlinks=False)
                if _TRIAL.fullmatch(entry.name):
                    trials.append(folder / entry.name)
                elif own and _ASIDE.fullmatch(entry.name):
                    aside.append(folder / entry.name)
                elif own and entry.name.startswith(_UNFINISHED):
                    unfinished.append(folder / entry.name)
                else:
                    foreign.append(folder / entry.name)
    except OSError as error:
        raise ParameterError(f"is no folder of trials ({error.strerror})", field="folder", value=str(folder)) from None
    return Contents(*(tuple(sorted(each)) for each in (trials, aside, unfinished, foreign)))


def kept(paths: Sequence[Path], progress: Progress = silent) -> tuple[list[Kept], list[tuple[Path, str]]]:
    """Headers of the files that can be read, and for each of the others what is wrong with it.

    Parameters
    ----------
    paths
        Paths of :func:`contents`.
    progress
        Called with the part done (0 to 1) and a few words.
    """
    return _looked_at(paths, read_header, progress)


def checked(paths: Sequence[Path], progress: Progress = silent) -> tuple[list[Kept], list[tuple[Path, str]]]:
    """The same of files that are whole to the last byte, and have the name that their trial has."""
    return _looked_at(paths, partial(read_header, whole=True), progress)


def clean(folder: Path, *, old: bool = False, dry: bool = False) -> tuple[list[Path], list[tuple[Path, str]]]:
    """Remove what is no trial's record and was written by chilopod: what was set aside, or left over by who was killed.

    Parameters
    ----------
    folder
        Folder of trials.
    old
        True to remove the records of other versions, too.
    dry
        True to remove nothing.

    Returns
    -------
    What was (or would be) removed, and what is left for a reason.

    Raises
    ------
    ParameterError
        If there is no such folder.
    OutputError
        If a file cannot be removed.
    """
    found = contents(folder)
    remove = list(found.aside)
    left = [(path, "not written by chilopod") for path in found.foreign]
    if nobody_in(folder):
        remove += found.unfinished
    else:
        left += [(path, "a process is walking here") for path in found.unfinished]
    if old:
        remove += [each.path for each in kept(found.trials)[0] if not each.found and not each.path.is_symlink()]
    for path in () if dry else remove:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(f"cannot be removed ({error.strerror})", source=str(path)) from None
    return remove, left


@dataclass(frozen=True)
class Group:
    """Trials of robots of one name that differ in nothing but the robots' numbers, their seeds, and where the
    targets of a course are.

    Attributes
    ----------
    robot, engine, controller
        By name; no controller is None.
    duration
        s.
    target
        Bearing, rad, and distance, m; of a course how many targets it has; None where there is none.
    found
        See :class:`Kept`.
    robots
        Number of robots, told apart by their numbers.
    seeds
        Seeds of those that are disturbed, in order.
    count
        Count of the trials.
    size
        Size of all files, bytes.
    """

    robot: str
    engine: str
    controller: str | None
    duration: float
    target: tuple[float, float] | int | None
    found: bool
    robots: int
    seeds: tuple[int, ...]
    count: int
    size: int


def groups(trials: Sequence[Kept]) -> list[Group]:
    """Trials in groups, in order of their names."""
    alike: dict[tuple[Any, ...], list[Kept]] = {}
    for each in trials:
        alike.setdefault(_what_groups_share(each), []).append(each)
    found = []
    for (robot, engine, controller, duration, target, is_found), group in alike.items():
        told = [each.told for each in group]
        found.append(
            Group(
                robot=robot,
                engine=engine,
                controller=controller,
                duration=duration,
                target=target,
                found=is_found,
                robots=len({each.get("robot") for each in told}),
                seeds=tuple(sorted({each["seed"] for each in told if any(each.get("disturbance", {}).values())})),
                count=len(group),
                size=sum(each.size for each in group),
            )
        )
    return sorted(found, key=lambda group: (group.robot, group.engine, repr(group)))


def _what_groups_share(trial: Kept) -> tuple[Any, ...]:
    # Other versions may tell less, or otherwise.
    told = trial.told
    controller = told.get("controller")
    return (
        trial.robot,
        told["engine"],
        str(controller.get("class", "")).partition(" ")[0] if isinstance(controller, dict) else None,
        told["duration"],
        _target_of(told),
        trial.found,
    )


def _target_of(told: dict[str, Any]) -> tuple[float, ...] | int | None:
    target = told.get("target")
    if isinstance(target, dict):
        return len(target.get("goals", ()))
    return tuple(target) if isinstance(target, list) else None


def _looked_at(
    paths: Sequence[Path], header_of: Callable[[Path], Header], progress: Progress
) -> tuple[list[Kept], list[tuple[Path, str]]]:
    found: list[Kept] = []
    wrong: list[tuple[Path, str]] = []
    for index, path in enumerate(paths):
        if index % _EVERY == 0:
            progress(index / len(paths), f"{index} of {len(paths)} trials")
        with suppress(FileNotFoundError):  # somebody was faster
            try:
                found.append(_kept(path, header_of(path)))
            except UnsoundError as error:
                wrong.append((path, str(error)))
    if paths:
        progress(1.0, f"{len(paths)} trials")
    return found, wrong


def _kept(path: Path, header: Header) -> Kept:
    text = header.attributes.get("trial", "")
    digest = digest_of(text)
    if not path.stem.endswith(f"-{digest}"):
        raise UnsoundError(
            f"holds another trial, whose name ends in {digest}.nc" if text else "is no record of a trial"
        )
    try:
        told = json.loads(text)
        # TOML begins with what stands in no section.
        robot = tomllib.loads(header.attributes["robot"].partition("\n[")[0])["name"]
        here = _versions(told["engine"])
        found = all(told.get(name) == version for name, version in here.items())
    except (LookupError, TypeError, ValueError, AttributeError):
        raise UnsoundError("is damaged or was edited") from None
    return Kept(path, header.size, robot, told, found)


def _versions(engine: str) -> dict[str, Any]:
    here = versions_of(engine if engine in ENGINES else ENGINES[0])
    if engine not in ENGINES:
        del here["engine_version"]
    return here
