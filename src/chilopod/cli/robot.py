"""``chilopod robot``: make, show, check and export robot files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from chilopod.cli.commands import new_app
from chilopod.cli.options import ForceOption, JsonOption, RobotArg, SetOption, print_json, read_robot, save

_PLANAR, _WHOLE = "aoi2022-planar", "aoi2022"

app = new_app("Make, show, check and export robot files.")


@app.command()
def new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Robot file to write, such as my.toml.")],
    modules: Annotated[
        str | None,
        typer.Option(
            metavar="N",
            help="Number of modules; the whole robot keeps its length and mass, the last spring is repeated.",
        ),
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
    robot = read_robot((_WHOLE if twin else _PLANAR) if preset is None else preset, None)
    if twin and robot.twin is None:
        robot = robot.with_twin_of(read_robot(_WHOLE, None))
    if modules is not None:
        robot = robot.override("body.modules", modules)
    robot = read_robot(robot, overrides).with_(name=file.stem)
    save(file, robot.to_toml(), robot, force=force, as_json=as_json, ending=".toml")


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
    if as_json:
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
        print_json(
            {
                "robot": described.name,
                "parameters": parameters,
                "derived": {name: {"value_si": value, "si_unit": unit} for name, (value, unit) in derived.items()},
            }
        )
        return
    rows = described.listed()
    rows += [(name, units.format(value, unit, digits=6), "derived") for name, (value, unit) in derived.items()]
    typer.echo("\n  ".join([described.name, *aligned(rows)]))


@app.command()
def check(robot: RobotArg, overrides: SetOption = None, as_json: JsonOption = False) -> None:
    """Check that a robot is valid, and list its unusual numbers.

    Example: chilopod robot check aoi2022-planar --set "gait.stride=10 cm"
    """
    from chilopod.robot import remarks

    described = read_robot(robot, overrides)
    found = remarks(described)
    if as_json:
        print_json({"robot": described.name, "valid": True, "remarks": found})
        return
    typer.echo(f"{described.name}: valid, {described.body.modules} modules")
    for remark in found:
        typer.echo(f"  {remark}")


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
