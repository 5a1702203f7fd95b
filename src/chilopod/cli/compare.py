"""``chilopod compare``: differing numbers of two robots, and the part of each in how they bend."""

from __future__ import annotations

from typing import Annotated

import typer

from chilopod.cli.options import AtOption, OnsetOptions, read_robot, with_options


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
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of orders, for more than 8 differences.")] = 0,
) -> None:
    """Differing numbers of two robots, and the part of each in the difference of where they bend.

    The onset is the value of the number at which the straight walk begins to bend. A part is the mean over all orders
    in which the numbers of the first robot can be changed to those of the second (Shapley value), so parts add up.

    Example: chilopod compare aoi2022-planar aoi2022
    """
    first, second = options.described, read_robot(other, options.overrides)
    onset = options.number(at)
    from chilopod import analysis

    names = show.split(",")
    options.study("comparison", lambda progress: analysis.compare(first, second, onset, names, seed, progress))
