"""``chilopod branch``: the curved walks beyond the pitchfork, and how tightly they turn."""

from __future__ import annotations

from typing import Annotated

import typer

from chilopod.cli.options import (
    BetweenOption,
    JsonOption,
    OutOption,
    ParameterOption,
    RobotArg,
    SetOption,
    interval,
    prepared,
    print_json,
    read_robot,
)
from chilopod.cli.progress import progress_bar


def branch(
    robot: RobotArg,
    parameter: ParameterOption = "springs.stiffness[0]",
    between: BetweenOption = ("7.5 N*mm/deg", "20 N*mm/deg"),
    points: Annotated[int, typer.Option(metavar="N", min=1, max=10_000, help="At most so many points.")] = 60,
    left: Annotated[
        bool, typer.Option("--left", help="Follow the left turn; it is the mirror image of the right.")
    ] = False,
    overrides: SetOption = None,
    as_json: JsonOption = False,
    out: OutOption = None,
) -> None:
    """Follow the curved walks from the pitchfork: radius, speed, stability, folds and what else happens on the way.

    With --out, draws the branch (unstable parts dashed) and writes it as netCDF and CSV.
    """
    described = read_robot(robot, overrides)
    low, high = interval(described, parameter, between)
    folder = prepared(out)
    from chilopod.studies.curved_walk import as_json as branch_json
    from chilopod.studies.curved_walk import curved_walks

    with progress_bar() as show:
        data = curved_walks(
            described,
            parameter,
            (low, high),
            points=points,
            side=-1 if left else 1,
            progress=lambda done, words: show("branch", done, words),
        )
    if folder:
        from chilopod.report import write_branch

        for path in write_branch(data, folder):
            typer.echo(f"wrote {path}", err=True)
    if as_json:
        print_json(branch_json(data))
        return
    unit = data.parameter.attrs["units"]
    typer.echo(f"{described.name}: curved walks over {parameter}; the branch ends: {data.attrs['ending']}")
    typer.echo(f"  {unit:<12} axis radius  path radius  speed (m/s)  cost of transport  stability")
    for i in range(data.sizes["point"]):
        at = data.isel(point=i)
        special = str(at.special.values)
        verdict = "stable" if bool(at.stable) else "unstable"
        typer.echo(
            f"  {float(at.parameter):<12.6g} {float(at.axis_radius):<11.4g}  {float(at.path_radius):<11.4g}  "
            f"{float(at.speed):<11.4g}  {float(at.cost_of_transport):<17.3g}  {special or verdict}"
        )
