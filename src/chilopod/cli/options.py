"""Arguments and options that commands share, and how they read a robot and print a result."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
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
ParameterOption = Annotated[
    str,
    typer.Option(metavar="PATH", help="What to vary, such as springs.stiffness[0]; springs.stiffness: all springs."),
]
BetweenOption = Annotated[
    tuple[str, str], typer.Option(metavar="LOW HIGH", help='The interval, such as "2 N*mm/deg" "75 N*mm/deg".')
]
OutOption = Annotated[Path | None, typer.Option("--out", metavar="FOLDER", help="Write results into this folder.")]
ForceOption = Annotated[bool, typer.Option("--force", help="Replace results that are already there.")]
SeedOption = Annotated[
    int | None,
    typer.Option(metavar="N", min=0, help="Disturb start, feet and sensor at random; without it nothing is disturbed."),
]
EngineOption = Annotated[
    str,
    typer.Option(
        metavar="planar|twin|MODULE:OBJECT",
        help="The paper's model, the whole robot in three dimensions (MuJoCo), or an engine of your own.",
    ),
]
ControllerOption = Annotated[
    str | None,
    typer.Option(metavar="MODULE:CLASS", help="A controller of your own, from this folder or an installed package."),
]
TrialsOption = Annotated[
    Path | None,
    typer.Option("--trials", metavar="FOLDER", help="Keep all trials here, and walk none that is there already."),
]
RepeatsOption = Annotated[
    int, typer.Option(metavar="N", min=1, max=100_000, help="Walks, with seeds counting up from --seed.")
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="ADDRESS|N",
        help="Trials walk on a dask cluster: the address of its scheduler, or N worker processes on this machine.",
    ),
]


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


@contextmanager
def walking_on(cluster: str | None) -> Iterator[None]:
    """Let trials of this block walk where ``--cluster`` says."""
    if cluster is None:
        yield
        return
    from chilopod.trials import Cluster, using

    is_number = cluster.lstrip("-").isdecimal()
    with Cluster(int(cluster[:9]) if is_number else cluster) as there, using(there):
        yield


def read_robot(robot: str, overrides: Sequence[str] | None) -> Robot:
    """Load a robot and apply what ``--set`` asked for."""
    from chilopod.robot import load_robot

    return load_robot(robot).set_from_text(overrides or ())


def print_json(result: dict[str, Any]) -> None:
    """Print a result as one JSON object; NaN and infinity have no place in JSON and are a fault here."""
    typer.echo(json.dumps(result, indent=2, allow_nan=False))


def prepared(folder: Path | None) -> Path | None:
    """Make the folder of ``--out``, if it was given, before any work is done for it."""
    if folder is None:
        return None
    from chilopod.output import prepare_folder

    return prepare_folder(folder)


def save_json(path: Path, result: dict[str, Any]) -> None:
    """Write a result as a JSON file and say so on stderr."""
    from chilopod.output import write_atomic

    write_atomic(path, json.dumps(result, indent=2, allow_nan=False) + "\n")
    typer.echo(f"wrote {path}", err=True)


def interval(robot: Robot, parameter: str, between: tuple[str, str]) -> tuple[float, float]:
    """Read the interval of a parameter, in SI units, and refuse one that is reversed or that the robot cannot have."""
    from chilopod import units
    from chilopod.errors import ParameterError

    low, high = (units.parse(text, robot.si_unit_of(parameter)) for text in between)
    if not low < high:
        raise ParameterError("must rise from a lower to a higher value", field="between", value=" ".join(between))
    for value in (low, high):
        robot.with_value(parameter, value)
    return low, high
