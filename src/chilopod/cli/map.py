"""``chilopod map``: where the straight walk holds, bends or undulates over two numbers of a robot."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from chilopod.cli.options import OutOption, RobotOptions, deliver, free, note_si, with_options
from chilopod.cli.progress import progress_bar
from chilopod.errors import known_names

_RANGE = "PATH LOW HIGH"


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
    result = options.free_in(out, "map.json")
    if out:
        from chilopod.show import files_of_map, write_map

        free(files_of_map(out), options.force)
    with progress_bar("map") as tell:
        found = mapped(
            robot, x, y, points=points, also=also, kept=out and out / "map-rates.nc", replace=options.force,
            remark=lambda sentence: typer.echo(f"note: {sentence}", err=True), progress=partial(tell, "map"),
        )  # fmt: skip
    for name, (path, *ends) in (("x", x), ("y", y)):
        note_si(robot, path, f"--{name} {path}", ends)

    def write() -> list[Path]:
        return write_map(found, shown, out, replace=options.force) if out else []

    deliver(write, lambda: options.deliver_json(result, found.as_json(), found.lines()))
