"""``chilopod sensitivity``, ``compare`` and ``size``: effect of each number of a robot on where it bends, part of
each in the difference of two robots, and numbers at which a robot does what is wished."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated, Any

import typer

from chilopod.cli.options import OnsetOptions, note_si, read_robot, with_options
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
    samples: Annotated[
        int | None,
        typer.Option(metavar="N", min=16, help="Samples with --uncertain, a power of two.", show_default="128"),
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="N", min=0, help="Seed of the samples.", show_default="0")] = None,
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
    for option, given in (("show", show), ("at", at)):
        if tolerances and given is not None:
            raise ParameterError("goes without --uncertain only", field=option, value=given, allowed="the onset alone")
    for option, number in (("samples", samples), ("seed", seed)):
        if not tolerances and number is not None:
            raise ParameterError("goes with --uncertain only", field=option, value=number)
    from chilopod import analysis
    from chilopod.analysis.sensitivity import DEFAULT

    if tolerances:
        how = described, tolerances, onset, 128 if samples is None else samples, seed or 0
        options.study("uncertainty", lambda progress: analysis.uncertainty(*how, progress))
    else:
        names = DEFAULT if show is None else show.split(",")
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
    """Tolerances by path, SI; that of a number goes before that of its group, and both before a share of all numbers,
    which leaves out those that are zero and that which varies."""
    from chilopod import units
    from chilopod.analysis.parameters import check_parameter, numbers_read
    from chilopod.robot.parameters import place_of

    found: dict[str, float] = {}
    width: dict[str, int] = {}  # of what a tolerance was given for: number, group, all
    others = [path for path in numbers_read(robot) if parameter not in (path, path.partition("[")[0])]
    for text in given:
        path, equals, tolerance = (each.strip() for each in text.partition("="))
        with concerning("uncertain"):
            share = _share(tolerance if equals else path)
            if share is not None and not 0.0 < share < 1.0:
                raise ParameterError("must be a share above 0 % and below 100 %", value=text)
            if equals:
                check_parameter(robot, path)
                if path == parameter:
                    raise ParameterError("must not be the number whose critical value is searched", value=text)
                stem, joints = path.partition("[")[0], place_of(path).joints(robot.body.modules - 1)
                paths = [each for each in others if each in [f"{stem}[{i}]" for i in joints]] or [path]
            elif share is not None:
                paths = [each for each in others if robot.get(each)]
            else:
                said = "must be a share, or a number with its tolerance"
                raise ParameterError(said, value=text, allowed="10%, body.mass=0.3 kg")
            wide = 2 if not equals else int(len(paths) > 1)
            for each in paths:
                if width.get(each) == wide:
                    raise ParameterError("must be given once", value=text, allowed=f"one tolerance of {each}")
                if width.get(each, wide) < wide:
                    continue
                width[each] = wide
                if share is None:
                    found[each] = units.parse(tolerance, robot.si_unit_of(each))
                    if not found[each] > 0.0:
                        raise ParameterError("must be positive", value=text)
                elif robot.get(each) == 0.0:
                    raise ParameterError(f"{each} is 0, which has no share", value=text, allowed=f"{each}=VALUE")
                else:
                    found[each] = share * abs(robot.get(each))
    return {each: found[each] for each in (*others, *found) if each in found}  # however they were given


def _share(text: str) -> float | None:
    """Number before a percent sign, as a share; None without one."""
    try:
        return 0.01 * float(text.removesuffix("%")) if text.endswith("%") else None
    except ValueError:
        return None


def _wish(quantity: str) -> Any:
    return Annotated[str | None, typer.Option(metavar="VALUE", help=f"Wished {quantity}.")]


@dataclass(frozen=True)
class _SizeOptions(OnsetOptions):
    """Argument, options and wishes, as they were typed."""

    radius: _wish("radius of the curved walk, by the paper's measure") = None  # type: ignore[valid-type]
    speed: _wish("speed along the curved walk, or along the straight one if that is stable") = None  # type: ignore[valid-type]
    onset: _wish("critical value of --parameter") = None  # type: ignore[valid-type]
    growth: _wish("growth rate of the leading mode of the straight walk") = None  # type: ignore[valid-type]
    margin: _wish("relative distance of --parameter from its onset, negative if the straight walk is unstable") = None  # type: ignore[valid-type]
    settling: _wish("time in which a disturbance of the walk falls to 1/e") = None  # type: ignore[valid-type]
    friction: _wish("relative change of the onset by a relative change of the floor's friction") = None  # type: ignore[valid-type]
    work: _wish("work of an actuator that stiffens the spring of the curved walk to its onset") = None  # type: ignore[valid-type]


_WISHES = tuple(each.name for each in fields(_SizeOptions) if each not in fields(OnsetOptions))


@with_options
def size(
    options: _SizeOptions,
    free: Annotated[
        list[str],
        typer.Option(
            metavar="PATH=LOW..HIGH",
            help='Free number and its range, such as "springs.stiffness[0]=5..60 N*mm/deg", a group of springs, or '
            "speed (of the straight walk, at the same stride and duty factor); may be repeated.",
        ),
    ],
    twin: Annotated[bool, typer.Option("--twin", help="Let the robot walk in three dimensions too.")] = False,
    budget: Annotated[int, typer.Option(metavar="N", min=1, help="Most evaluations of robots.")] = 1200,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of the scattered starts.")] = 0,
) -> None:
    """Numbers of a robot at which it does what is wished, checked in walks.

    A wish that begins with < or > is a limit. One wish on one free number is solved as an equation, others by least
    squares within the ranges. If no robot meets all wishes, it names the nearest one, the ends of ranges and the wishes
    that stand in the way, and the Pareto front of two wishes that conflict. The robot walks in the planar model, and
    with --twin in three dimensions. One half of --budget is for the search, the other to say what stands in the way; a
    branch of curved walks counts as 20. With --out, writes sized.toml, whose provenance says what was computed and what
    was copied.

    Example: chilopod size aoi2022-planar --radius "0.8 m" --free "springs.stiffness[0]=5..60 N*mm/deg" --out sized
    """
    robot = options.described
    onset = options.number()
    wishes = {name: text for name in _WISHES if (text := getattr(options, name)) is not None}
    if not wishes:
        raise ParameterError("must be given", field=" or ".join(f"--{name}" for name in _WISHES))
    ranges = [_range(text) for text in free]
    for path, *ends in ranges:
        note_si(robot, path, f"--free {path}", ends)
    from chilopod import tasks

    how: dict[str, Any] = {"twin": twin, "budget": budget, "seed": seed}
    asked = robot, wishes, ranges, onset
    options.study("size", lambda progress: tasks.size(*asked, **how, progress=progress), "sized.toml")


def _range(text: str) -> tuple[str, str, str]:
    """Path and both ends of a range; the unit of the upper end is that of both."""
    path, equals, both = (each.strip() for each in text.partition("="))
    low, dots, high = (each.strip() for each in both.partition(".."))
    if not (equals and dots):
        allowed = "springs.stiffness[0]=5..60 N*mm/deg"
        raise ParameterError("must be a number with its range", field="free", value=text, allowed=allowed)
    unit = high.partition(" ")[2]
    return path, low if " " in low or not unit else f"{low} {unit}", high
