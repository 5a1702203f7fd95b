"""Arguments and options that commands share, and how they read a robot and print a result."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cached_property, partial
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from chilopod.cli.progress import progress_bar
from chilopod.errors import ChilopodError, OutputError, ParameterError, concerning

if TYPE_CHECKING:
    from chilopod.analysis import Onset
    from chilopod.progress import Progress
    from chilopod.robot import Robot


def _engines() -> list[str]:
    from chilopod.engine import ENGINES

    return list(ENGINES)


def choices(which: str) -> list[tuple[str, str]]:
    """Names and sentences of the strategies in a mapping of :mod:`chilopod.steering`, for completion and help."""
    from chilopod import steering

    return [(each.name, each.sentence) for each in getattr(steering, which).values()]


RobotArg = Annotated[
    str, typer.Argument(metavar="ROBOT", help="Robot file, or one of the presets aoi2022 and aoi2022-planar.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help='Other value of a number of the robot, such as "springs.stiffness[0]=12 N*mm/deg"; may be repeated. '
        "`chilopod robot show` lists all numbers.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout instead of text.")]
ParameterOption = Annotated[
    str,
    typer.Option(
        metavar="PATH",
        help="Number of the robot that varies, such as springs.stiffness[0], the first yaw spring (the paper's k1), or "
        "springs.stiffness, all springs together.",
    ),
]
OnsetBetweenOption = Annotated[
    tuple[str, str] | None,
    typer.Option(
        metavar="LOW HIGH",
        help='Interval of its values, with their unit, such as "2 N*mm/deg" "75 N*mm/deg"; by default, of springs, '
        "0.04 to 1.6 times friction x speed x duty factor x module length.",
    ),
]
OutOption = Annotated[
    Path | None, typer.Option("--out", metavar="FOLDER", help="Folder for the results, besides the text.")
]
ForceOption = Annotated[bool, typer.Option("--force", help="Replace files that are already there.")]
EngineOption = Annotated[
    str,
    typer.Option(
        metavar="planar|twin|MODULE:OBJECT",
        help="Engine that computes the walk. planar: the paper's model; twin: the whole robot in three dimensions, by "
        "MuJoCo (needs a [twin] section, as in aoi2022); or an engine of your own.",
        autocompletion=_engines,
    ),
]


def quantity(option: str, text: str, unit: str) -> float:
    """Read the value of an option, in SI units."""
    from chilopod import units

    with concerning(option):
        return units.parse(text, unit)


def read_robot(robot: str | Robot, overrides: Sequence[str] | None) -> Robot:
    """Load a robot, unless it is one, and apply the overrides of ``--set``."""
    from chilopod.robot import Robot, load_robot

    described = robot if isinstance(robot, Robot) else load_robot(robot)
    with concerning(within="--set"):
        return described.set_from_text(overrides or ())


@dataclass(frozen=True)
class RobotOptions:
    """Argument and options of commands that compute something of a robot, as they were typed."""

    robot: RobotArg
    overrides: SetOption = None
    as_json: JsonOption = False
    force: ForceOption = False

    @cached_property
    def described(self) -> Robot:
        """Robot with the numbers that ``--set`` changed."""
        return read_robot(self.robot, self.overrides)

    def free_in(self, folder: Path | None, name: str) -> list[Path]:
        """The file of this name in the folder, if there is one, which can be written; see :func:`free`."""
        files = [folder / name] if folder else []
        free(files, self.force)
        return files

    def deliver_json(self, files: Sequence[Path], result: dict[str, Any], lines: Iterable[str]) -> None:
        """Write a result into these files as JSON, and print it as that or as lines of text."""
        from chilopod.output import write_all

        texts = [(file, json_text(result) + "\n") for file in files]
        deliver(lambda: write_all(texts, replace=self.force), lambda: print_result(result, lines, self.as_json))


@dataclass(frozen=True)
class OnsetOptions(RobotOptions):
    """Argument and options of commands that study where a robot bends, as they were typed."""

    parameter: ParameterOption = "springs.stiffness[0]"
    between: OnsetBetweenOption = None
    out: OutOption = None

    def number(self, at: str | None = None) -> Onset:
        """The number that bends the robot, its interval, and the value at which walks are studied."""
        return onset_of(self.described, self.parameter, self.between, at)

    def study(self, name: str, compute: Callable[[Progress], Any], robot_file: str | None = None) -> None:
        """Compute a result, write it into the folder, if there is one, as JSON, as its plot and, if that has a name, as
        the file of its robot, and print it."""
        names = [f"{name}.{kind}" for kind in ("json", "svg", "png")] + ([robot_file] if robot_file else [])
        free([self.out / each for each in names] if self.out else [], self.force)
        with progress_bar(name) as bar:
            found = compute(partial(bar, name))
        result = found.as_json()
        texts = {robot_file: found.robot.to_toml()} if robot_file else {}
        texts[f"{name}.json"] = json_text(result) + "\n"

        def write() -> list[Path]:
            from chilopod.show import write_result

            return write_result(found, texts, name, self.out, replace=self.force) if self.out else []

        deliver(write, lambda: print_result(result, found.lines(), self.as_json))


def with_options(command: Callable[..., None]) -> Callable[..., None]:
    """Decorator that shows typer the fields of a command's first argument, a dataclass, beside its other arguments."""
    arguments = signature(command, eval_str=True).parameters.values()
    first, *own = (each.replace(kind=Parameter.KEYWORD_ONLY) for each in arguments)
    hints = get_type_hints(first.annotation, include_extras=True)
    given = signature(first.annotation).parameters.values()
    robot, *shared = (each.replace(kind=Parameter.KEYWORD_ONLY, annotation=hints[each.name]) for each in given)
    common = {each.name for each in fields(RobotOptions)}

    def run(**typed: Any) -> None:
        options = {each.name: typed.pop(each.name) for each in (robot, *shared)}
        command(first.annotation(**options), **typed)

    # What all commands have comes last.
    seen = [robot, *own, *sorted(shared, key=lambda each: each.name in common)]
    run.__doc__, run.__annotations__ = command.__doc__, {each.name: each.annotation for each in seen}
    vars(run)["__signature__"] = Signature(seen)
    return run


def print_result(result: dict[str, Any], lines: Iterable[str], as_json: bool) -> None:
    """Print a result as one JSON object, or as lines of text."""
    typer.echo(json_text(result) if as_json else "\n".join(lines))


def json_text(result: dict[str, Any]) -> str:
    """A result as one JSON object; NaN and infinity have no place in JSON and are a fault here."""
    return json.dumps(result, indent=2, allow_nan=False)


def free(paths: Iterable[Path], force: bool, ending: str = "") -> None:
    """Make sure, before any work is done for them, that files can be written, that none is replaced without
    ``--force``, and that no name ends as that of another format; it may have no ending."""
    from chilopod.output import check_files

    files = list(paths)
    for file in files:
        if ending and file.suffix.lower() not in ("", ending):
            raise ParameterError(f"must end with {ending}", source=str(file))
    check_files(files, replace=force)


def save(file: Path, text: str, robot: Robot, *, force: bool, as_json: bool, ending: str = "", **more: str) -> None:
    """Write the text of a robot into a file, and name that, as JSON or as text."""
    from chilopod.output import write_all

    free([file], force, ending)
    write_all([(file, text)], replace=force)
    said = ": ".join([f"wrote {file}", *more.values()])
    print_result({"robot": robot.name, "file": str(file), **more}, [said], as_json)


def deliver(write: Callable[[], Iterable[Path]], show: Callable[[], None]) -> None:
    """Write the files of a result, name them on stderr, and print the result, also where a file cannot be written."""
    failure = None
    try:
        written: Iterable[object] = write()
    except OutputError as error:
        failure, written = error, error.written
    for path in written:
        typer.echo(f"wrote {path}", err=True)
    try:
        show()
    finally:
        if failure is not None:
            raise failure


def interval(robot: Robot, parameter: str, between: tuple[str, ...], option: str = "between") -> tuple[float, float]:
    """Read the interval of a parameter, in SI units, and refuse one that is reversed or that the robot cannot have."""
    from chilopod import units
    from chilopod.analysis.parameters import check_parameter

    with concerning("parameter" if option == "between" else option):
        check_parameter(robot, parameter)
    unit = robot.si_unit_of(parameter)
    with concerning(f"{option} {parameter}"):
        low, high = (units.parse(text, unit) for text in between)
        for text in between:
            robot.override(parameter, text)
    if not low < high:
        raise ParameterError("must rise from a lower to a higher value", field=option, value=" ".join(between))
    note_si(robot, parameter, f"--{option}", between)
    return low, high


def note_si(robot: Robot, path: str, option: str, ends: Sequence[str]) -> None:
    """Say what a range is taken for if it has no unit; a range that is none is refused where it is read."""
    from chilopod import units

    with suppress(ChilopodError):
        unit, shown = robot.si_unit_of(path), robot.unit_of(path)
        if shown != unit and any(map(_bare, ends)):
            values = [units.parse(end, unit) for end in ends]
            taken, own = (" to ".join(units.format(value, u, digits=4) for value in values) for u in (unit, shown))
            typer.echo(f"note: a number without a unit is SI: {option} is {taken}, that is {own}", err=True)


def onset_of(robot: Robot, parameter: str, between: tuple[str, str] | None, at: str | None = None) -> Onset:
    """Read the number that bends a robot, its interval, and the value at which walks are studied."""
    from chilopod.analysis.parameters import check_parameter

    with concerning("parameter"):
        check_parameter(robot, parameter)
    limits = between and interval(robot, parameter, between)
    with concerning("at"):
        studied = None if at is None else robot.override(parameter, at).get(parameter)
    from chilopod.analysis import Onset

    with concerning("between"):
        return Onset(parameter, limits, studied)


def _bare(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
