"""``chilopod size``: numbers of a robot at which it does what is wished."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated, Any

import typer

from chilopod.cli.options import OnsetOptions, note_si, with_options
from chilopod.errors import ParameterError


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
    file = options.free_in(options.out, "sized.toml")
    from chilopod import tasks
    from chilopod.output import write_atomic

    how: dict[str, Any] = {"twin": twin, "budget": budget, "seed": seed}
    found = options.study("size", lambda progress: tasks.size(robot, wishes, ranges, onset, **how, progress=progress))
    for each in file:
        write_atomic(each, found.robot.to_toml(), replace=options.force)
        typer.echo(f"wrote {each}", err=True)


def _range(text: str) -> tuple[str, str, str]:
    """Path and both ends of a range; the unit of the upper end is that of both."""
    path, equals, both = (each.strip() for each in text.partition("="))
    low, dots, high = (each.strip() for each in both.partition(".."))
    if not (equals and dots):
        allowed = "springs.stiffness[0]=5..60 N*mm/deg"
        raise ParameterError("must be a number with its range", field="free", value=text, allowed=allowed)
    unit = high.partition(" ")[2]
    return path, low if " " in low or not unit else f"{low} {unit}", high
