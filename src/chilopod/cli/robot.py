"""``chilopod robot``: make, show, check and export robot files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from chilopod.cli.commands import new_app
from chilopod.cli.options import ForceOption, JsonOption, RobotArg, SetOption, print_result, read_robot, save
from chilopod.errors import ChilopodError, ParameterError, concerning

if TYPE_CHECKING:
    from chilopod.robot import Robot

_PLANAR, _WHOLE = "aoi2022-planar", "aoi2022"
_FOLLOWED = 12  # modules of robots whose curved walks a check follows, which takes seconds
_PATIENCE = 10.0  # s for that, without compilation

app = new_app("Make, show, check and export robot files.")


@app.command()
def new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Robot file to write, such as my.toml.")],
    modules: Annotated[
        str | None,
        typer.Option(
            metavar="N",
            help="Number of modules; the whole robot keeps its mass, and its length unless --module-length is given; "
            "the last spring is repeated.",
        ),
    ] = None,
    module_length: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Length of a module; that of the whole robot follows.")
    ] = None,
    body_length: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Length of the whole robot; that of a module follows.")
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT",
            help=f"Robot to start from, a preset or a file; by default {_PLANAR}, with --twin {_WHOLE}.",
        ),
    ] = None,
    twin: Annotated[
        bool,
        typer.Option(
            "--twin",
            help="Write a [twin] section, so that the robot walks in three dimensions too; that of "
            f"{_WHOLE} where the robot to start from has none.",
        ),
    ] = False,
    overrides: SetOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a new robot file, named after the file, to edit by hand.

    Example: chilopod robot new my.toml --modules 8
    """
    robot = read_robot((_WHOLE if twin else _PLANAR) if preset is None else preset, None).copied()
    if twin and robot.twin is None:
        robot = robot.with_twin_of(read_robot(_WHOLE, None).copied())
    if modules is not None:
        robot = robot.override("body.modules", modules)
    robot = _lengthened(robot, module_length, body_length)
    robot = read_robot(robot, overrides).with_(name=file.stem)
    lengths = f"{robot.body.modules} modules of {robot.module_length:.4g} m, {robot.body.length:.4g} m in all"
    save(file, robot.to_toml(), robot, force=force, as_json=as_json, ending=".toml", size=lengths)


def _lengthened(robot: Robot, module_length: str | None, body_length: str | None) -> Robot:
    """The robot with another length of its modules or of its body."""
    from chilopod import units

    if module_length and body_length:
        raise ParameterError("must not be given with --body-length", field="module_length", value=module_length)
    if body_length:
        with concerning("body_length"):
            return robot.override("body.length", body_length)
    if module_length:
        with concerning("module_length"):
            return robot.with_value("body.length", units.parse(module_length, "m") * robot.body.modules)
    return robot


@app.command()
def show(robot: RobotArg, overrides: SetOption = None, as_json: JsonOption = False) -> None:
    """Print every number of a robot, its unit, and where it comes from.

    Example: chilopod robot show aoi2022-planar --set "body.mass=10 kg"
    """
    from chilopod import units
    from chilopod.notebook import aligned

    described = read_robot(robot, overrides)
    derived = {
        "module_length": (described.module_length, "m"),
        "module_mass": (described.module_mass, "kg"),
        "module_yaw_inertia": (described.module_yaw_inertia, "kg*m^2"),
        "period": (described.gait.period, "s"),
        "duty": (described.gait.duty, ""),
        "speed": (described.gait.speed, "m/s"),
    }
    parameters = {}
    for path in described.parameters():
        value, unit = described.get(path), described.unit_of(path)
        parameters[path] = {
            "value": units.from_si(value, unit),
            "unit": unit,
            "value_si": value,
            "si_unit": described.si_unit_of(path),
            "provenance": described.provenance_of(path),
        }
    found = {"robot": described.name, "parameters": parameters}
    found["derived"] = {name: {"value_si": value, "si_unit": unit} for name, (value, unit) in derived.items()}
    rows = described.listed()
    rows += [(name, units.format(value, unit, digits=6), "derived") for name, (value, unit) in derived.items()]
    print_result(found, [described.name, *(f"  {line}" for line in aligned(rows))], as_json)


@app.command()
def check(robot: RobotArg, overrides: SetOption = None, as_json: JsonOption = False) -> None:
    """Check that a robot is valid, and list its unusual numbers.

    Example: chilopod robot check aoi2022-planar --set "gait.stride=10 cm"
    """
    from chilopod.robot import remarks

    described = read_robot(robot, overrides)
    found = [*remarks(described), *_out_of_reach(described)]
    lines = [f"{described.name}: valid, {described.body.modules} modules", *(f"  {remark}" for remark in found)]
    print_result({"robot": described.name, "valid": True, "remarks": found}, lines, as_json)


def _out_of_reach(robot: Robot) -> Iterator[str]:
    """Sentences about legs that cannot follow their paths, and joints that bend too far on the curved walk."""
    from chilopod.analysis.quantities import Measured, Onset, leading_mode
    from chilopod.flows.deadline import Deadline
    from chilopod.planar.stretch import MOST_BENT

    if robot.twin is not None:
        from chilopod.twin import TwinModel

        try:
            TwinModel(robot)
        except ChilopodError as error:
            yield f"The robot cannot walk in three dimensions: {error}."
    if robot.body.modules > _FOLLOWED:
        return
    bends = False
    with Deadline(_PATIENCE) as limit, suppress(ChilopodError):  # no curved walk is known
        bends = leading_mode(robot).growth > 0.0 and Measured(Onset()).most_bent(robot) > MOST_BENT
    if bends:
        yield "A joint bends beyond a right angle on the curved walk, where walks end: the springs are too soft."
    elif limit.late:
        yield f"The curved walk takes more than {_PATIENCE:g} s to compute: whether its joints bend too far is unknown."


@app.command(short_help="Write the robot in 3-D for other programs (MJCF, URDF).")
def export(
    robot: RobotArg,
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE", help="File to write: .xml for MJCF (MuJoCo), .urdf for URDF.")
    ],
    overrides: SetOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write the three-dimensional model of a robot, which must have a [twin] section, for other programs.

    Example: chilopod robot export aoi2022 --out robot.urdf
    """
    from chilopod.twin.export import format_of

    name, write = format_of(out.suffix)
    described = read_robot(robot, overrides)
    save(out, write(described), described, force=force, as_json=as_json, format=name)
