"""Every option of every command with values of all kinds, alone and in pairs; every number of a robot at extremes."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from random import Random

from chilopod.robot.parameters import QUANTITIES
from commands import Option, commands, flags, given, typed
from in_process import Place, called, snapshot
from outcomes import Kind, Outcome, judged, strict_json
from values import NUMBERS, PLACES, any_text

# Those that take long where they are not refused are tried less often.
_SELDOM = {
    ("reproduce",): 0.3,
    ("identify", "twin"): 0.15,
    ("identify", "planar"): 0.3,
    ("doctor",): 0.1,
    ("turn",): 0.6,
}
_EXTREMES = (*NUMBERS[:24], "0.5", "7", "1e-3", "1e-6", "1e3", "1e6")
_ROBOT_VERBS = {
    ("robot", "show"): 8,
    ("robot", "check"): 8,
    ("stability",): 5,
    ("walk",): 5,
    ("bifurcation",): 1,
    ("branch",): 1,
    ("turn",): 1,
    ("robot", "export"): 1,
}


_QUICK = ("robot", "walk", "stability")


class Arguments:
    """Command lines, and ``--set``."""

    name = "arguments"
    per_minute = 500

    def __init__(self, quick: bool = False) -> None:
        self._quick = quick

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One command line."""
        furnish(place.here)
        words, named = (with_extreme if chance.random() < 0.4 else with_bad_values)(chance, self._quick)
        place.tried.write_text(shlex.join(["chilopod", *words])[:400], errors="replace")
        before = snapshot(place.root)
        ending = called(words, place)
        kind = judged(
            ending,
            before,
            snapshot(place.root),
            named=named,
            codes=(0, 3) if "doctor" in words else (0,),
            interrupted=place.interrupted.exists(),
        )
        if kind is Kind.ENDED and "--json" in words and not {"--help", "--version"} & {*words}:
            strict_json(ending.out)
        return Outcome(kind, ending.err.strip()[-200:])


def furnish(here: Path) -> None:
    """Put everything into a folder that a path can lead to."""
    (here / "folder").mkdir()
    (here / "file").write_text("precious")
    (here / "empty").write_bytes(b"")
    os.mkfifo(here / "fifo")
    os.symlink("nowhere", here / "dangling")
    os.symlink("loop", here / "loop")
    os.symlink("file", here / "link")


def with_extreme(chance: Random, quick: bool) -> tuple[list[str], list[str]]:
    """A robot with one or two numbers changed; the words, and what they name."""
    verbs = {command.words: command for command in commands()}
    known = {verb: often for verb, often in _ROBOT_VERBS.items() if verb[0] in _QUICK[:1] or not quick}
    (verb,) = chance.choices(tuple(known), tuple(known.values()))
    words = given(verbs[verb])
    twin = chance.random() < 0.25
    if twin and verb != ("robot", "export"):
        words[words.index("aoi2022-planar")] = "aoi2022"
        if verb == ("walk",) and chance.random() < 0.1:
            words[words.index("0.3 s")] = "0.02 s"
            words += ["--engine", "twin"]
    for _ in range(chance.choice((1, 1, 2))):
        path = chance.choice([path for path in QUANTITIES if twin or not path.startswith("twin.")])
        index = f"[{chance.choice((0, 0, 1, 4, 5))}]" if QUANTITIES[path].each and chance.random() < 0.5 else ""
        unit = (
            getattr(QUANTITIES[path], "display", "") if chance.random() < 0.5 else getattr(QUANTITIES[path], "si", "")
        )
        words += ["--set", f"{path}{index}={chance.choice(_EXTREMES)} {unit}".rstrip()]
    if chance.random() < 0.3:
        words.append("--json")
    return words, []


def with_bad_values(chance: Random, quick: bool) -> tuple[list[str], list[str]]:
    """A command with one or two options that are wrong."""
    all_commands = [command for command in commands() if command.words[0] in _QUICK or not quick]
    (command,) = chance.choices(all_commands, [_SELDOM.get(each.words, 1.0) for each in all_commands])
    if not command.options:
        return [*command.words, any_text(chance)], []
    hit = chance.sample(command.options, min(len(command.options), chance.choice((1, 1, 2))))
    words = given(command, {each.name for each in hit})
    values: list[str] = []
    for option in hit:
        bad = [_bad(option, chance) for _ in range(option.values)]
        values += bad
        words += typed(option, *bad)
    how = chance.randrange(20)
    if how == 0:
        words.append(chance.choice(sorted(flags())))
    elif how == 1:
        values.append(any_text(chance))
        words.append(values[-1])
    elif how == 2 and len(words) > 1:
        words.pop(chance.randrange(1, len(words)))
    elif how == 3:
        words.insert(0, "--version")
    elif how < 7:
        words.append("--force")
    parts = (
        part
        for value in values
        for part in (value[:30], repr(value)[1:31].rstrip("'"), f"error: {Path(value).parent}: ")
        if len(value) > 2
    )
    return words, list(parts)


def _bad(option: Option, chance: Random) -> str:
    is_path = {"out", "resume", "trials", "file", "robot", "preset"} & {option.name}
    if is_path and chance.random() < 0.7:
        place = chance.choice(PLACES)
        inner = chance.choice(("", "", "/x.nc", "/new", ".nc")) if not place.startswith("/") else ""
        return place + inner
    if option.name == "overrides":
        path = chance.choice(list(QUANTITIES))
        behind, sign = chance.choice(("", "[0]", "[9]", "[", ".x", " ")), chance.choice(("=", "=", "=", "", "=="))
        return f"{path}{behind}{sign}{any_text(chance)}"
    return any_text(chance)
