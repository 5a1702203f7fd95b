"""Arguments and options that commands share, and how they read a robot and print a result."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from chilopod.robot import Robot

RobotArg = Annotated[str, typer.Argument(metavar="ROBOT", help="A robot file, or the name of a preset.")]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help='Override a number, such as springs.stiffness[0]="12 N*mm/deg"; may be repeated.',
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout instead of text.")]
OutOption = Annotated[Path | None, typer.Option("--out", metavar="FOLDER", help="Write results into this folder.")]


def new_app(help_text: str) -> typer.Typer:
    """Return an empty group of commands with the settings all groups share."""
    # Help without rich: importing it costs a third of what --help may take. Tracebacks are the business of `main`.
    return typer.Typer(
        help=help_text,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        add_completion=False,
        no_args_is_help=False,
    )


def read_robot(robot: str, overrides: Sequence[str] | None) -> Robot:
    """Load a robot and apply what ``--set`` asked for."""
    from chilopod.robot import load_robot

    return load_robot(robot).set_from_text(overrides or ())


def print_json(result: dict[str, Any]) -> None:
    """Print a result as one JSON object; NaN and infinity have no place in JSON and are a fault here."""
    typer.echo(json.dumps(result, indent=2, allow_nan=False))
