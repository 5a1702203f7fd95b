"""``chilopod trials``: list, check and clean a folder of trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from chilopod.cli.commands import new_app
from chilopod.cli.options import JsonOption, print_result
from chilopod.cli.progress import progress_bar

if TYPE_CHECKING:
    from chilopod.trials.folder import Group

BROKEN = 2
"""Exit code where a file is damaged."""

app = new_app("List, check and clean a folder in which trials are kept.")

FolderArg = Annotated[
    Path, typer.Argument(metavar="FOLDER", help="Folder given to --trials, or the folder `trials` of a report.")
]


@app.command("list")
def listed(folder: FolderArg, as_json: JsonOption = False) -> None:
    """List the trials in a folder: robots, durations, targets and seeds.

    Only the front of every file is read; `chilopod trials check` reads all of it. The column robots counts robots of
    one name that differ in their numbers. A controller of your own has its code in brackets: trials from before and
    after a change of it are rows of their own.

    Example: chilopod trials list report/trials
    """
    from chilopod.memory import in_words
    from chilopod.notebook import aligned
    from chilopod.trials.folder import contents, groups, kept

    there = contents(folder)
    with progress_bar("trials") as show:
        trials, wrong = kept(there.trials, lambda part, words: show("list", part, words))
    rows, size = groups(trials), sum(each.size for each in trials)
    others = sum(not each.current for each in trials)
    found: dict[str, Any] = {"folder": str(folder), "trials": len(trials), "bytes": size, "of_other_versions": others}
    head = ("robot", "engine", "walk", "target", "controller", "robots", "seeds", "trials", "size")
    lines = [*(aligned([head, *map(_cells, rows)]) if rows else []), f"{_trials(len(trials))}, {in_words(size)}"]
    if others:
        lines.append(f"{_trials(others)} of another version: this one does not find them (clean --old removes them)")
    aside = "set aside, because they were not what they should be (chilopod trials clean removes them)"
    left = "being written, or left over by a killed process (chilopod trials clean removes the latter)"
    for key, paths, words in (
        ("unreadable", [path for path, _ in wrong], "that cannot be read (chilopod trials check says why)"),
        ("set_aside", there.aside, aside),
        ("unfinished", there.unfinished, left),
        ("foreign", there.foreign, "of no trial"),
    ):
        found[key] = [path.name for path in paths]
        lines += [f"{len(paths)} file{'s' * (len(paths) > 1)} {words}"] * bool(paths)
    print_result({**found, "groups": [_as_json(row) for row in rows]}, lines, as_json)


def _as_json(row: Group) -> dict[str, Any]:
    """A group of trials; of several targets there is only their number."""
    one = row.target if isinstance(row.target, tuple) else None
    return {
        "robot": row.robot,
        "robots": row.robots,
        "engine": row.engine,
        "controller": row.controller,
        "code": row.code or None,
        "duration_s": row.duration,
        "target": {"bearing_rad": one[0], "distance_m": one[1]} if one else None,
        "targets": 1 if one else row.target or 0,
        "seeds": _ranges(row.seeds),
        "trials": row.count,
        "bytes": row.size,
        "of_this_version": row.current,
    }


def _cells(row: Group) -> tuple[str, ...]:
    from chilopod.memory import in_words

    target = f"course of {row.target}" if row.target else "-"
    if isinstance(row.target, tuple):
        target = f"{math.degrees(row.target[0]):.4g} deg, {row.target[1]:g} m"
    controller = row.controller.rpartition(":")[2] if row.controller else "-"
    controller += f" (code {row.code[:6]})" if row.code else ""
    numbers = str(row.robots), _ranges(row.seeds) or "-", str(row.count)
    size = f"{in_words(row.size)}{'' if row.current else ', another version'}"
    return row.robot, row.engine, f"{row.duration:g} s", target, controller, *numbers, size


@app.command(short_help="Check that every trial in a folder is whole.")
def check(folder: FolderArg, as_json: JsonOption = False) -> None:
    """Check that every trial in a folder is whole: its checksum, and that its name belongs to its content.

    All of every file is read. Each damaged file is a line; the exit code is 0, or 2 if there is one. A command that
    walks sets such a file aside and walks the trial again. Trials of another version of chilopod or MuJoCo are counted:
    they are whole, but are walked again too.

    Example: chilopod trials check report/trials
    """
    from chilopod.trials.folder import checked, contents

    with progress_bar("trials") as show:
        whole, wrong = checked(contents(folder).trials, lambda part, words: show("check", part, words))
    others = sum(not each.current for each in whole)
    found = {"folder": str(folder), "whole": len(whole), "of_other_versions": others}
    said = f"{_trials(len(whole))} whole, {len(wrong)} not"
    said += f"; {others} of another version, which this one does not find" if others else ""
    names = [{"file": path.name, "what": words} for path, words in wrong]
    print_result({**found, "wrong": names}, [*(f"{path} {words}" for path, words in wrong), said], as_json)
    if wrong:
        raise typer.Exit(BROKEN)


@app.command(short_help="Remove files that were set aside or left unfinished.")
def clean(
    folder: FolderArg,
    old: Annotated[bool, typer.Option("--old", help="Remove trials of other versions too.")] = False,
    dry: Annotated[bool, typer.Option("--dry-run", help="List what would be removed, and remove nothing.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Remove useless files from a folder of trials: those set aside, and those that killed processes left unfinished.

    Files that are no trials, and those that a process is writing, stay and are listed. A damaged file stays
    until its trial is walked again, which sets it aside.

    Example: chilopod trials clean report/trials --dry-run
    """
    from chilopod.trials.folder import clean as cleaned

    removed, left = cleaned(folder, old=old, dry=dry)
    found = {
        "folder": str(folder),
        "dry_run": dry,
        "removed": [path.name for path in removed],
        "left": [{"file": path.name, "why": why} for path, why in left],
    }
    lines = [f"{'would remove' if dry else 'removed'} {path}" for path in removed]
    lines += [f"left {path}: {why}" for path, why in left]
    done = "to be removed" if dry else "removed"
    lines.append(f"{len(removed)} {done}, {len(left)} other files left beside the trials")
    print_result(found, lines, as_json)


def _ranges(numbers: Sequence[int]) -> str:
    """Numbers in order as ``1-4, 7``."""
    runs = [[each for _, each in run] for _, run in groupby(enumerate(numbers), lambda pair: pair[1] - pair[0])]
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)


def _trials(count: int) -> str:
    return f"{count} trial{'s' * (count != 1)}"
