"""All commands and options there are, asked of the application itself: a new one is attacked without being told of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import typer

from chilopod.cli import app


@dataclass(frozen=True)
class Option:
    """An option or argument of a command.

    Attributes
    ----------
    name
        As the code has it.
    flags
        As it is typed, the last one preferred; empty for an argument.
    values
        How many values it takes; 0 for a flag.
    required
        Whether it must be there.
    """

    name: str
    flags: tuple[str, ...]
    values: int
    required: bool


@dataclass(frozen=True)
class Command:
    """A command with its options."""

    words: tuple[str, ...]
    options: tuple[Option, ...]


# Good values of what a command must have, and of what would take long otherwise; by command, else for all.
_GOOD: dict[str, tuple[str, ...]] = {
    "robot": ("aoi2022-planar",),
    "target": ("45 deg, 1.3 m",),
    "parameter": ("springs.stiffness[0]",),
    "between": ("11.5 N*mm/deg", "12.5 N*mm/deg"),
    "duration": ("0.3 s",),
    "points": ("3",),
    "starts": ("1",),
    "generations": ("1",),
    "seconds": ("5",),
    "file": ("new.toml",),
    "only": ("mode",),
    "tiny": (),
}
_OWN: dict[tuple[str, ...], dict[str, tuple[str, ...]]] = {
    ("robot", "export"): {"robot": ("aoi2022",), "out": ("x.xml",)},
    ("identify", "twin"): {"robot": ("aoi2022",)},
    ("turn",): {"k1": ("12 N*mm/deg",)},
}


def commands() -> tuple[Command, ...]:
    """All commands, in the order of their help."""
    return tuple(_walk(typer.main.get_command(app), ()))


def given(command: Command, but: set[str] = frozenset(), **more: tuple[str, ...]) -> list[str]:
    """The words of a command that is quickly done, without some of its options.

    Parameters
    ----------
    command
        The command.
    but
        Names of options that are left out.
    more
        Values of other options.
    """
    good = {**_GOOD, **_OWN.get(command.words, {}), **more}
    words = list(command.words)
    for option in command.options:
        if option.name not in but and option.name in good:
            words += typed(option, *good[option.name])
    return words


def typed(option: Option, *values: str) -> list[str]:
    """An option with its values as it is typed."""
    return [*option.flags[-1:], *values]


@lru_cache
def flags() -> frozenset[str]:
    """All that begins with a dash."""
    return frozenset(flag for command in commands() for option in command.options for flag in option.flags)


def _walk(command: Any, words: tuple[str, ...]) -> Iterator[Command]:
    inner = getattr(command, "commands", None)
    if inner:
        for name, each in inner.items():
            yield from _walk(each, (*words, name))
        return
    options = []
    for each in command.params:
        is_argument = each.param_type_name == "argument"
        flags = () if is_argument else tuple(sorted(each.opts, key=len))
        values = 0 if getattr(each, "is_flag", False) else abs(each.nargs)
        options.append(Option(each.name, flags, values, each.required))
    yield Command(words, tuple(options))
