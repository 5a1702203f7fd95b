"""``chilopod stability`` and ``chilopod bifurcation``: when does the straight walk hold, and where does it give way?"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from chilopod.cli import options as shared
from chilopod.cli.options import (
    EngineOption,
    OnsetBetweenOption,
    OutOption,
    ParameterOption,
    RobotOptions,
    with_options,
)
from chilopod.cli.progress import progress_bar
from chilopod.cli.walking import own_code
from chilopod.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable

    from chilopod.analysis import CycleMultipliers
    from chilopod.robot import Robot


_AMPLITUDE = "1 deg"


@with_options
def stability(
    options: RobotOptions,
    engine: EngineOption = "planar",
    amplitude: Annotated[
        str, typer.Option(metavar="ANGLE", help='Size of the bends that the twin is given, such as "1 deg".')
    ] = _AMPLITUDE,
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
    size = shared.quantity("amplitude", amplitude, "rad")
    if engine == "planar" and onset:
        raise ParameterError("must be 'twin' for --onset", field="engine", value=engine, allowed="chilopod bifurcation")
    if engine == "planar" and amplitude != _AMPLITUDE:
        raise ParameterError("must be 'twin' for --amplitude", field="engine", value=engine)
    if not 0.0 < size < 1.0:
        allowed = "above 0, below 1 rad"
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

    path, unit = onset[0], robot.unit_of(onset[0])
    try:
        point = bend_onset(multipliers, robot, path, shared.interval(robot, path, onset[1:]))
    except ParameterError as error:
        error.field = "onset" if error.field in ("between", "parameter") else error.field
        raise
    shown = [units.format(each, unit, digits=4) for each in (point.value, point.low, point.high)]
    said = f"{robot.name}: multiplier of bends passes 1 at {path} = {shown[0]}, 95 %: {shown[1]} to {shown[2]}"
    found = {"robot": robot.name, "parameter": path, "onset_si": point.value, "interval_si": [point.low, point.high]}
    return found, [said]


@with_options
def bifurcation(
    options: RobotOptions,
    parameter: ParameterOption,
    between: OnsetBetweenOption = None,
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
