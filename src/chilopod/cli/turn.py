"""``chilopod turn``: let a robot walk to a target."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from chilopod.cli.options import OutOption, choices, reading, with_options
from chilopod.cli.walking import WalkOptions

if TYPE_CHECKING:
    from chilopod.progress import Progress
    from chilopod.tasks import Turn


@with_options
def turn(
    options: WalkOptions,
    target: Annotated[
        str,
        typer.Option(
            metavar="BEARING, DISTANCE", help='Target, such as "45 deg, 1.3 m"; a positive bearing is to the left.'
        ),
    ],
    k1: Annotated[
        str,
        typer.Option(
            "--k1",
            metavar="auto|law|VALUE",
            help="Stiffness of the springs that the strategy softens. auto: nearest to the target in undisturbed "
            "trials; law: the settled walk is the circle to the target (the paper's k1-hat); or a value such as "
            '"10 N*mm/deg".',
        ),
    ] = "auto",
    strategy: Annotated[
        str, typer.Option(help="Strategy of turning.", autocompletion=lambda: choices("STRATEGIES"))
    ] = "pitchfork",
    duration: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            help='Time to walk, such as "30 s"; by default 1.6 (planar) or 2.8 (twin) times what the circle to the '
            "target takes at the speed of the straight walk, 5 s at least.",
        ),
    ] = None,
    out: OutOption = None,
) -> None:
    """Pick the spring that leads to a target, walk there, and report the outcome.

    The robot arrives where it comes within 0.15 m of the target. The criteria are the paper's. Epsilon 1 is the
    distance to the target and epsilon 2 the angle between heading and target when the first walk arrives. Epsilon 3 is
    the cost of steering until then, the integral of the squared leg yaw.

    With --out, draws the way and writes the record, and a replay that opens in any browser.

    Example: chilopod turn aoi2022-planar --target "45 deg, 1.3 m" --out turn
    """
    from chilopod import units
    from chilopod.steering import Target, strategy_named

    described = options.described
    goal, chosen = Target.parse(target), strategy_named(strategy)
    spring = k1 if k1 in ("auto", "law") else options.spring(chosen.springs, k1, "auto", "law")
    with reading("duration"):
        seconds = None if duration is None else units.parse(duration, "s")

    def results(progress: Callable[[str], Progress]) -> Turn:
        from chilopod.tasks import turn as walk_there

        how = {"duration": seconds, **options.steering}
        return walk_there(described, goal, chosen, spring, **how, **options.runs(progress("turn")))

    options.walk_into(out, "turn", results)
