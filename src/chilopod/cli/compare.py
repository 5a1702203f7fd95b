"""``chilopod compare``: differing numbers of two robots, and the part of each in how they bend."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from chilopod.cli.options import (
    OnsetBetweenOption,
    OutOption,
    ParameterOption,
    RobotOptions,
    deliver_result,
    free_result,
    onset_of,
    read_robot,
    reading,
    with_options,
)
from chilopod.cli.progress import progress_bar
from chilopod.cli.sensitivity import AtOption


@with_options
def compare(
    options: RobotOptions,
    other: Annotated[str, typer.Argument(metavar="OTHER", help="Robot to compare with; --set changes both.")],
    parameter: ParameterOption = "springs.stiffness[0]",
    between: OnsetBetweenOption = None,
    at: AtOption = None,
    show: Annotated[
        str,
        typer.Option(
            metavar="NAMES",
            help="Quantities, with commas: onset, growth, frequency, coefficient, radius and speed (of the curved "
            "walk), settling, margin, friction, work.",
        ),
    ] = "onset,growth,speed",
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of orders, for more than 8 differences.")] = 0,
    out: OutOption = None,
) -> None:
    """Differing numbers of two robots, and the part of each in the difference of where they bend.

    The onset is the value of the number at which the straight walk begins to bend. A part is the mean over all orders
    in which the numbers of the first robot can be changed to those of the second (Shapley value), so parts add up.

    Example: chilopod compare aoi2022-planar aoi2022
    """
    first, second = options.described, read_robot(other, options.overrides)
    onset = onset_of(first, parameter, between, at)
    free_result("comparison", out, options.force)
    from chilopod import analysis
    from chilopod.analysis.quantities import QUANTITIES, known_names

    with reading("show"):
        names = known_names(show.split(","), QUANTITIES, "show")
    with progress_bar("comparison") as bar:
        found = analysis.compare(first, second, onset, names, seed, partial(bar, "comparison"))
    deliver_result(found, "comparison", options, out)
