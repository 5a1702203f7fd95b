"""Arguments and options that commands share, and how they read a robot and print a result."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from chilopod.robot import Robot

STAYS_STRAIGHT = "nothing disturbed it, so nothing bends it, even where the straight walk is unstable"


def _engines() -> list[str]:
    from chilopod.engine import ENGINES

    return list(ENGINES)


def _strategies() -> list[str]:
    from chilopod.steering import STRATEGIES

    return list(STRATEGIES)


RobotArg = Annotated[
    str, typer.Argument(metavar="ROBOT", help="A robot file, or one of the presets aoi2022 and aoi2022-planar.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help='Change a number of the robot, such as "springs.stiffness[0]=12 N*mm/deg"; may be repeated. '
        "`chilopod robot show` lists them all.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout instead of text.")]
ParameterOption = Annotated[
    str,
    typer.Option(
        metavar="PATH",
        help="Which number of the robot to vary, such as springs.stiffness[0], the first yaw spring (the paper's k1), "
        "or springs.stiffness, all of them together.",
    ),
]
BetweenOption = Annotated[
    tuple[str, str],
    typer.Option(metavar="LOW HIGH", help='Between which values, with their unit, such as "2 N*mm/deg" "75 N*mm/deg".'),
]
OutOption = Annotated[
    Path | None, typer.Option("--out", metavar="FOLDER", help="Write the results into this folder too.")
]
ForceOption = Annotated[bool, typer.Option("--force", help="Replace files that are already there.")]
SeedOption = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        min=0,
        help="Disturb start, feet and sensor a little, at random; the same seed disturbs in the same way. Without it "
        "nothing is disturbed.",
    ),
]
EngineOption = Annotated[
    str,
    typer.Option(
        metavar="planar|twin|MODULE:OBJECT",
        help="What computes the walk: the paper's planar model, the whole robot in three dimensions (MuJoCo; a robot "
        "with a [twin] section, such as aoi2022), or an engine of your own.",
        autocompletion=_engines,
    ),
]
StrategyOption = Annotated[
    str,
    typer.Option(
        metavar="pitchfork|hopf|leg-yaw|open-loop",
        help="How it turns. pitchfork: a soft first spring, and the legs of module 1 yaw towards the target; hopf: all "
        "springs alike and soft, with leg yaw; leg-yaw: leg yaw alone; open-loop: a soft first spring alone.",
        autocompletion=_strategies,
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
    int, typer.Option(metavar="N", min=1, max=100_000, help="How many walks, with seeds counting up from --seed.")
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="ADDRESS|N",
        help="Trials walk on a dask cluster: the address of its scheduler, or N worker processes on this machine.",
    ),
]


def new_app(help_text: str, *, completion: bool = False) -> typer.Typer:
    """Return an empty group of commands with the settings all groups share.

    Parameters
    ----------
    help_text
        What it is for.
    completion
        Whether it has the options that make a shell complete its commands; only the outermost can.
    """
    # Help without rich: importing it costs a third of what --help may take. Tracebacks are the business of `main`.
    return typer.Typer(
        help=help_text,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        add_completion=completion,
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
    typer.echo(json_text(result))


def json_text(result: dict[str, Any]) -> str:
    """A result as :func:`print_json` prints it."""
    return json.dumps(result, indent=2, allow_nan=False)


def print_creep(coefficient: float | None) -> None:
    """Say how firmly the floor holds standing feet, where they creep."""
    if coefficient is not None:
        typer.echo(f"  standing feet creep like viscous ones of {coefficient:.0f} N*s/m")


def free(paths: Iterable[Path], force: bool) -> None:
    """Make sure, before any work is done for them, that files can be written and replace none without ``--force``."""
    from chilopod.output import check_files

    check_files(paths, replace=force)


def deliver(write: Callable[[], Iterable[Path]], show: Callable[[], None]) -> None:
    """Write the files of a result, say so on stderr, and print the result, also where a file cannot be written.

    Parameters
    ----------
    write
        Gives what it wrote.
    show
        Prints.
    """
    from chilopod.errors import OutputError

    failure = None
    try:
        for path in write():
            typer.echo(f"wrote {path}", err=True)
    except OutputError as error:
        failure = error
    try:
        show()
    finally:
        if failure is not None:
            raise failure


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
