"""``chilopod sensitivity`` and ``chilopod compare``: effect of each number of a robot on where it bends, with its
spread, and the part of each number in the difference of two robots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from chilopod.cli.options import OnsetOptions, read_robot, with_options
from chilopod.errors import ParameterError, concerning

if TYPE_CHECKING:
    from chilopod.robot import Robot

AtOption = Annotated[
    str | None,
    typer.Option(
        metavar="VALUE",
        help="Value of --parameter at which growth, frequency and radius are taken; by default that of the robot.",
    ),
]


@with_options
def sensitivity(
    options: OnsetOptions,
    at: AtOption = None,
    show: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Quantities, with commas: onset, growth, frequency (these by default), coefficient (takes a hundred "
            "normal forms), radius and speed (of the curved walk), settling, margin, friction, work.",
        ),
    ] = None,
    uncertain: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SHARE|PATH=TOLERANCE",
            help='Tolerance of all numbers, such as "10%", or of one, such as "body.mass=0.3 kg" or '
            '"ground.friction=20%"; may be repeated.',
        ),
    ] = None,
    samples: Annotated[int, typer.Option(metavar="N", min=16, help="Samples with --uncertain, a power of two.")] = 128,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of the samples.")] = 0,
) -> None:
    """Effect of each number of a robot on where it bends: derivatives with respect to every number of its file.

    The onset is the value of the number at which the straight walk loses stability (bends or undulates), as it falls or
    as it rises. Growth and frequency are those of the leading mode of the straight walk. With --uncertain it prints the
    spread of the onset where numbers are uniform within tolerances, and the share of each number in it.

    Example: chilopod sensitivity aoi2022-planar --uncertain 10%
    """
    described = options.described
    onset = options.number(at)
    tolerances = _tolerances(described, options.parameter, uncertain or [])
    for option, text in (("show", show), ("at", at)):
        if tolerances and text:
            raise ParameterError("goes without --uncertain only", field=option, value=text, allowed="the onset alone")
    from chilopod import analysis
    from chilopod.analysis.sensitivity import DEFAULT

    if tolerances:
        given = described, tolerances, onset, samples, seed
        options.study("uncertainty", lambda progress: analysis.uncertainty(*given, progress))
    else:
        names = show.split(",") if show else DEFAULT
        options.study("sensitivity", lambda progress: analysis.sensitivity(described, onset, names, progress=progress))


@with_options
def compare(
    options: OnsetOptions,
    other: Annotated[str, typer.Argument(metavar="OTHER", help="Robot to compare with; --set changes both.")],
    at: AtOption = None,
    show: Annotated[
        str,
        typer.Option(
            metavar="NAMES",
            help="Quantities, with commas: onset, growth, frequency, coefficient, radius and speed (of the curved "
            "walk), settling, margin, friction, work.",
        ),
    ] = "onset,growth,speed",
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of orders, for more than 9 differences.")] = 0,
) -> None:
    """Differing numbers of two robots, and the part of each in the difference of where they bend.

    The onset is the value of the number at which the straight walk loses stability (bends or undulates). A part is the
    mean over all orders in which the numbers of the first robot can be changed to those of the second (Shapley value),
    so parts add up. Robots that differ in ten numbers or more take minutes, and a note says how many: 64 random orders
    stand for all, and ± is half of the 95 % interval. A part is unknown where a robot in between has no such quantity,
    or moves far faster than both.

    Example: chilopod compare aoi2022-planar aoi2022
    """
    first, second = options.described, read_robot(other, options.overrides)
    onset = options.number(at)
    from chilopod import analysis

    names = show.split(",")
    how = names, seed, lambda said: typer.echo(f"note: {said}", err=True)
    options.study("comparison", lambda progress: analysis.compare(first, second, onset, *how, progress))


def _tolerances(robot: Robot, parameter: str, given: list[str]) -> dict[str, float]:
    """Tolerances by path, SI; a share of all numbers leaves out those that are zero and that which varies."""
    from chilopod import units
    from chilopod.analysis.parameters import check_parameter, numbers_read
    from chilopod.robot.parameters import place_of

    found: dict[str, float] = {}
    named: set[str] = set()
    others = [path for path in numbers_read(robot) if parameter not in (path, path.partition("[")[0])]
    for text in given:
        path, equals, tolerance = (each.strip() for each in text.partition("="))
        with concerning("uncertain"):
            share = _share(tolerance if equals else path)
            if share is not None and not 0.0 < share < 1.0:
                raise ParameterError("must be a share above 0 % and below 100 %", value=text)
            if equals:
                check_parameter(robot, path)
                if path in named:
                    raise ParameterError("must be given once", value=text)
                if path == parameter:
                    raise ParameterError("must not be the number whose critical value is searched", value=text)
                named.add(path)
                stem, joints = path.partition("[")[0], place_of(path).joints(robot.body.modules - 1)
                paths = [each for each in others if each in [f"{stem}[{i}]" for i in joints]] or [path]
            elif share is not None:
                paths = [each for each in others if robot.get(each) and each not in found]
            else:
                said = "must be a share, or a number with its tolerance"
                raise ParameterError(said, value=text, allowed="10%, body.mass=0.3 kg")
            for each in paths:
                if share is None:
                    found[each] = units.parse(tolerance, robot.si_unit_of(each))
                    if not found[each] > 0.0:
                        raise ParameterError("must be positive", value=text)
                elif robot.get(each) == 0.0:
                    raise ParameterError(f"{each} is 0, which has no share", value=text, allowed=f"{each}=VALUE")
                else:
                    found[each] = share * abs(robot.get(each))
    return found


def _share(text: str) -> float | None:
    """Number before a percent sign, as a share; None without one."""
    try:
        return 0.01 * float(text.removesuffix("%")) if text.endswith("%") else None
    except ValueError:
        return None
