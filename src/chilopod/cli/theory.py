"""``chilopod stability``, ``bifurcation``, ``branch`` and ``map``: when does the straight walk hold, where does it give
way, and which curved walks are beyond?"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from chilopod.cli import options as shared
from chilopod.cli.options import EngineOption, OutOption, ParameterOption, RobotOptions, with_options
from chilopod.cli.progress import progress_bar
from chilopod.cli.walking import own_code
from chilopod.errors import ParameterError, concerning, known_names

if TYPE_CHECKING:
    import xarray as xr

    from chilopod.analysis import CycleMultipliers
    from chilopod.robot import Robot


_AMPLITUDE = "1 deg"
_AROUND = 5.0 / 8.0, 5.0 / 3.0  # ends of the default interval, relative to the pitchfork
_RANGE = "PATH LOW HIGH"


@with_options
def stability(
    options: RobotOptions,
    engine: EngineOption = "planar",
    amplitude: Annotated[
        str | None, typer.Option(metavar="ANGLE", help=f'Size of the bends of the twin, by default "{_AMPLITUDE}".')
    ] = None,
    onset: Annotated[
        tuple[str, str, str] | None,
        typer.Option(metavar="PATH LOW HIGH", help="Number of the robot, and values between which bends set in."),
    ] = None,
    out: OutOption = None,
) -> None:
    """Floquet multipliers, exponents and modes of the straight walk: is it stable?

    A small disturbance is a sum of modes. A mode grows with its exponent, and by its multiplier from one period T of
    the gait to the next: the walk is stable if every |multiplier| is below 1, every exponent's real part below 0.
    Exponents are the principal logarithms of the multipliers over T: their imaginary parts lie in (-pi/T, pi/T].

    The twin has leading multipliers of its smallest bends, if its walk repeats from cycle to cycle, and of bends of a
    given size, whose contacts with the floor may differ. With --onset PATH LOW HIGH, such as "springs.stiffness[0]"
    "28 N*mm/deg" "41 N*mm/deg", it is the value at which the multiplier of these bends passes 1, with its interval.

    Example: chilopod stability aoi2022 --engine twin --set "springs.stiffness[0]=41 N*mm/deg"
    """
    described = options.described
    files = options.free_in(out, "stability.json")
    size = shared.quantity("amplitude", _AMPLITUDE if amplitude is None else amplitude, "rad")
    if engine == "planar" and onset:
        raise ParameterError("must be 'twin' for --onset", field="engine", value=engine, allowed="chilopod bifurcation")
    if engine == "planar" and amplitude is not None:
        raise ParameterError("must be 'twin' for --amplitude", field="engine", value=engine)
    from chilopod.analysis.cycle_multipliers import LEAST

    if not LEAST <= size < 1.0:
        allowed = f"{LEAST:g} rad or more, which rounding does not hide, below 1 rad"
        raise ParameterError("must be a small angle", field="amplitude", value=amplitude, allowed=allowed)
    with progress_bar("stability") as show:
        if engine == "planar":
            from chilopod.analysis import straight_walk

            walk = straight_walk(described)
            result, lines = walk.as_json(), walk.lines()
        else:
            from chilopod.analysis import walk_multipliers

            with own_code(show):
                result, lines = _of_bends(described, partial(walk_multipliers, engine=engine, amplitude=size), onset)
    options.deliver_json(files, result, lines)


def _of_bends(
    robot: Robot, multipliers: Callable[[Robot], CycleMultipliers], onset: tuple[str, str, str] | None
) -> tuple[dict[str, Any], list[str]]:
    if onset is None:
        walk = multipliers(robot)
        return walk.as_json(), walk.lines()
    from chilopod import units
    from chilopod.analysis import bend_onset

    path, between = onset[0], shared.interval(robot, onset[0], onset[1:], "onset")
    point, unit = bend_onset(multipliers, robot, path, between), robot.unit_of(path)
    shown = [units.format(each, unit, digits=4) for each in (point.value, point.low, point.high)]
    said = f"{robot.name}: multiplier of bends passes 1 at {path} = {shown[0]}, 95 %: {shown[1]} to {shown[2]}"
    found = {"robot": robot.name, "parameter": path, "onset_si": point.value, "interval_si": [point.low, point.high]}
    return found, [said]


@with_options
def bifurcation(
    options: RobotOptions,
    parameter: ParameterOption,
    between: shared.OnsetBetweenOption = None,
    seconds: Annotated[
        float, typer.Option(metavar="S", min=0.0, help="Time limit, s; the search ends with what it found.")
    ] = 60.0,
    out: OutOption = None,
) -> None:
    """Bifurcations of the straight walk: values of one number of the robot at which its stability changes.

    Every bifurcation in the interval has its kind, its error bound, the mode that grows, and its direction: new walks
    set in gently (supercritical) or by a jump (subcritical).

    Example: chilopod bifurcation aoi2022-planar --parameter "springs.stiffness[0]"
    """
    described = options.described
    limits = shared.onset_of(described, parameter, between).interval(described)
    files = options.free_in(out, "bifurcation.json")
    from chilopod import units
    from chilopod.analysis import bifurcations

    remarks: list[str] = []
    with progress_bar("bifurcation"):
        points = bifurcations(described, parameter, limits, remark=remarks.append, seconds=seconds)
    for text in remarks:
        typer.echo(f"note: {text}", err=True)
    result = {"robot": described.name, "points": [point.as_json() for point in points], "complete": not remarks}
    ends = " and ".join(units.format(each, described.unit_of(parameter), digits=6) for each in limits)
    found = "no bifurcation" if not remarks else "the search is incomplete, and found no bifurcation"
    none = f"{described.name}: {found} of the straight walk for {parameter} between {ends}"
    options.deliver_json(files, result, [line for point in points for line in point.lines()] or [none])


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

    shared.deliver(write, lambda: shared.print_result(plain(data), _lines(data), options.as_json))


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


@with_options
def stability_map(
    options: RobotOptions,
    x: Annotated[
        tuple[str, str, str],
        typer.Option(
            metavar=_RANGE,
            help='Number on the horizontal axis and its range, such as "springs.stiffness[0]" "5 N*mm/deg" '
            '"75 N*mm/deg"; a group of springs, such as "springs.stiffness[1:]"; speed, at the same stride and duty '
            "factor; modules, each of the same length and mass.",
        ),
    ],
    y: Annotated[tuple[str, str, str], typer.Option(metavar=_RANGE, help="The same for the vertical axis.")],
    show: Annotated[
        str,
        typer.Option(
            metavar="NAMES", help="Pictures, with commas between: kind, growth, frequency, radius, criticality."
        ),
    ] = "kind,growth",
    points: Annotated[int, typer.Option(metavar="N", min=2, max=4097, help="Least number of values on an axis.")] = 129,
    folds: Annotated[
        bool, typer.Option("--folds", help="Follow the folds of the curved walks too, which takes a minute.")
    ] = False,
    out: OutOption = None,
) -> None:
    """Map of the straight walk over two numbers of the robot: where it holds, and where it bends or undulates.

    Growth rates are computed on a grid that is fine where neighbours differ. The curves between, pitchforks and
    Neimark-Sacker points, are continued exactly, with error bounds; so are the points where they meet, and where they
    turn from gentle (supercritical) to sudden (subcritical, dashed). Cells without a robot, and those that could not be
    computed, have colours of their own.

    With --out, draws the map, and writes it as netCDF, CSV and JSON. Growth rates are kept in the folder as they are
    computed: a map that was interrupted goes on with them, and so does one with twice the points.

    Example: chilopod map aoi2022-planar --x "springs.stiffness[0]" "5 N*mm/deg" "75 N*mm/deg" --y legs.forward_offset
    "0 mm" "60 mm" --out atlas
    """
    robot = options.described
    from chilopod.analysis.map import map as mapped
    from chilopod.analysis.map_picture import SHOWN

    shown = [name.strip() for name in show.split(",")]
    known_names(shown, SHOWN, "show", "must name pictures")
    also = [name for name, wanted in (("folds", folds), ("radius", "radius" in shown)) if wanted]
    if out:
        from chilopod.show import files_of_map, write_map

        shared.free(files_of_map(out), options.force)
    with progress_bar("map") as tell:
        found = mapped(
            robot, x, y, points=points, also=also, kept=out and out / "map-rates.nc", replace=options.force,
            remark=lambda sentence: typer.echo(f"note: {sentence}", err=True), progress=partial(tell, "map"),
        )  # fmt: skip
    for name, (path, *ends) in (("x", x), ("y", y)):
        shared.note_si(robot, path, f"--{name} {path}", ends)

    result = found.as_json()

    def write() -> list[Path]:
        return write_map(found, shared.json_text(result) + "\n", shown, out, replace=options.force) if out else []

    shared.deliver(write, lambda: shared.print_result(result, found.lines(), options.as_json))
