"""``chilopod branch``: the curved walks beyond the pitchfork, and how tightly they turn."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from chilopod.cli import options as shared
from chilopod.cli.options import OutOption, ParameterOption, RobotOptions, print_result, with_options
from chilopod.cli.progress import progress_bar
from chilopod.errors import ParameterError, concerning

if TYPE_CHECKING:
    import xarray as xr

    from chilopod.robot import Robot

_AROUND = 5.0 / 8.0, 5.0 / 3.0  # ends of the default interval, relative to the pitchfork

BetweenOption = Annotated[
    tuple[str, str] | None,
    typer.Option(
        metavar="LOW HIGH",
        help="Interval; by default that of the branch that is resumed, or, of springs, about 5/8 to 5/3 of the one at "
        "which the straight walk gives way.",
    ),
]
PointsOption = Annotated[
    int,
    typer.Option(metavar="N", min=1, max=10_000, help="Largest number of points; with --resume, of further points."),
]
ResumeOption = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="Folder of a saved branch to go on with; without --out it grows there."),
]


@with_options
def branch(
    options: RobotOptions,
    parameter: ParameterOption = "springs.stiffness[0]",
    between: BetweenOption = None,
    points: PointsOption = 60,
    longest: Annotated[
        float,
        typer.Option(
            metavar="STEP",
            min=1e-4,
            max=10.0,
            help="Largest step along the branch, without a unit; halve it for points half as far apart.",
        ),
    ] = 0.15,
    left: Annotated[
        bool, typer.Option("--left", help="Follow the left turn, the mirror image of the right one.")
    ] = False,
    out: OutOption = None,
    resume: ResumeOption = None,
) -> None:
    """Follow the curved walks from the pitchfork at which the straight walk gives way: how tightly they turn, how
    fast and stable they are, folds and other points on the way.

    The axis radius is that of the arc of the body, as in the paper; the path radius that of the circle on the floor;
    the cost of transport is leg power over weight times speed. Points at which a joint bends by more than a right
    angle, where walks end, are out of range.

    With --out, draws the branch (unstable parts dashed, those out of range dotted) and writes it as netCDF and CSV;
    --resume goes on with it.

    Example: chilopod branch aoi2022-planar --between "7.5 N*mm/deg" "20 N*mm/deg" --out curved
    """
    described = options.described
    limits = shared.interval(described, parameter, between) if between else None
    from chilopod.analysis.branch import as_json as plain
    from chilopod.analysis.branch import curved_walks, read_walks, resumed

    with concerning("resume"):
        saved = None if resume is None else read_walks(resume / "branch.nc")
    if left and saved is not None and saved.attrs["side"] > 0:
        raise ParameterError("must be left out: the saved branch turns right", field="--left")
    folder = out or resume
    # A branch that goes on where it is saved holds all it held before.
    replace = options.force or (folder is not None and resume is not None and folder.resolve() == resume.resolve())
    if folder:
        from chilopod.show import files_of

        shared.free(files_of("branch", folder), replace)
    with progress_bar("branch") as show:
        how: dict[str, Any] = {"points": points, "longest": longest, "progress": partial(show, "branch")}
        if saved is None:
            limits = limits or _around(described, parameter)
            data = curved_walks(described, parameter, limits, side=-1 if left else 1, **how)
        else:
            data = resumed(saved, described, parameter, limits, side=-1 if left else None, **how)

    def write() -> list[Path]:
        from chilopod.show import write_branch

        return write_branch(data, folder, replace=replace) if folder else []

    shared.deliver(write, lambda: print_result(plain(data), _lines(data), options.as_json))


def _around(robot: Robot, parameter: str) -> tuple[float, float]:
    """Interval of a spring around the pitchfork, SI, with ends of two digits."""
    from chilopod import units

    value, unit = shared.onset_of(robot, parameter, None).first(robot).point.value, robot.unit_of(parameter)
    low, high = (f"{units.from_si(part * value, unit):.2g} {unit}" for part in _AROUND)
    return shared.interval(robot, parameter, (low, high))


def _lines(data: xr.Dataset) -> list[str]:
    from chilopod.notebook import aligned

    unit, about = data.parameter.attrs["units"], data.attrs
    agrees = "confirms" if about["direction_confirms"] == "yes" else "does not confirm"
    head = (unit, "axis radius (m)", "path radius (m)", "speed (m/s)", "cost of transport", "stability")
    cells: list[tuple[str, ...]] = [head]
    for i in range(data.sizes["point"]):
        at = data.isel(point=i)
        special, verdict = str(at.special.values), str(at.verdict.values)
        # At a special point a multiplier is 1, and nothing else is to be said of stability.
        shown = special if special and verdict == "undecided" else ", ".join(filter(None, (special, verdict)))
        numbers = (f"{float(value):.4g}" for value in (at.axis_radius, at.path_radius, at.speed))
        cells.append((f"{float(at.parameter):.6g}", *numbers, f"{float(at.cost_of_transport):.3g}", shown))
    return [
        f"{about['robot']}: curved walks over {about['varied']}; the branch ends: {about['ending']}",
        f"  the normal form says {about['criticality']}; the direction in which the branch leaves {agrees} it",
        *(f"  {line}" for line in aligned(cells)),
    ]
