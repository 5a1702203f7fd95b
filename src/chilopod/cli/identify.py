"""``chilopod identify``: the constants that the paper does not print."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from chilopod.cli.commands import new_app
from chilopod.cli.options import RobotOptions, deliver, free, json_text, print_json, with_options
from chilopod.cli.progress import progress_bar
from chilopod.errors import ParameterError

if TYPE_CHECKING:
    from chilopod.output import Content
    from chilopod.robot import Robot
    from chilopod.tasks.identify import NextMeasurements, SelfTest

app = new_app("Find constants of a model from measured or printed numbers.")

OutOption = Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where results go.")]


@dataclass(frozen=True)
class _PlanarOptions(RobotOptions):
    """Argument and options of ``identify planar``, as they were typed."""

    robot: Annotated[str, typer.Argument(metavar="[ROBOT]", help="A robot file or preset.")] = "aoi2022-planar"
    out: OutOption = Path("identification")
    points: Annotated[int, typer.Option(metavar="N", help="Number of points of the profile.", min=3, max=200)] = 25
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="FILE", help="TOML file of your own data; by default the paper's numbers."),
    ] = None
    template: Annotated[bool, typer.Option("--template", help="Print a file for --data, and end.")] = False
    measure: Annotated[bool, typer.Option("--next", help="Say which measurements would tell most.")] = False
    check: Annotated[
        int, typer.Option("--check", metavar="N", help="Identify N robots whose constants are known.", min=0, max=10000)
    ] = 0


@app.command("planar", short_help="Constants of the planar model from a critical spring and its mode.")
@with_options
def planar(options: _PlanarOptions) -> None:
    """Friction, half-width and forward offset of the feet from the critical k1 and its mode, with their uncertainty.

    Writes the profile over the forward offset as a figure and as data, and the robot with the best constants. The
    data are the numbers that the paper prints, or your own. --next ranks measurements by what they would leave of the
    uncertainty. --check makes up N robots around the answer and counts how often the ranges cover their constants.

    If FILE names recorded walks (joint angles over time, CSV or netCDF), any constants that it calls free are fitted to
    these, with 90 % intervals and the combinations that the walks leave open. --template shows both kinds of file.

    Example: chilopod identify planar --data mine.toml --out identification
    """
    from chilopod.tasks import identify

    data, out = options.data, options.out
    if _template(options.template, data, identify.TEMPLATE):
        return
    described = options.described
    from chilopod.paper.fit_data import critical_mode_data, variant_settings
    from chilopod.show import files_of
    from chilopod.show.figures import identification
    from chilopod.show.files import panel_files

    measured, variants = (critical_mode_data(), variant_settings()) if data is None else (identify.load_data(data), {})
    free([*files_of("identification", out), *_identified(out)], options.force)
    more: dict[str, NextMeasurements | SelfTest] = {}
    with progress_bar("identification") as progress:
        step = partial(progress, "identification")
        if isinstance(measured, identify.RecordedWalks):
            if options.measure or options.check:
                raise ParameterError("must not be given with recorded walks", field="--next, --check")
            walked = identify.identify_recorded(described, measured, (data or Path()).parent, step)
            lines, numbers, best, panel = walked.lines(), walked.found, walked.best, identification.recorded(walked)
        else:
            found = identify.identify_planar(described, measured, options.points, variants, step)
            lines, numbers, best, panel = found.lines(), found.as_json(), found.best, identification.panel(found)
            if options.measure:
                more["next"] = identify.next_measurements(found, progress=partial(progress, "next measurements"))
            if options.check:
                step = partial(progress, "self-test")
                more["check"] = identify.self_test(best, measured, options.check, progress=step)
    lines += [*(line for each in more.values() for line in each.lines()), f"data, figure and robot file are in {out}"]
    result = {"robot": described.name, **numbers, **{name: each.as_json() for name, each in more.items()}}
    _deliver(options, out, result, best, lines, panel_files(panel, out, out))


@dataclass(frozen=True)
class _TwinOptions(RobotOptions):
    """Argument and options of ``identify twin``, as they were typed."""

    robot: Annotated[str, typer.Argument(metavar="[ROBOT]", help="A robot file or preset with a [twin].")] = "aoi2022"
    out: OutOption = Path("identification-twin")
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="FILE", help="TOML file of your own data; by default the paper's numbers."),
    ] = None
    template: Annotated[bool, typer.Option("--template", help="Print a file for --data, and end.")] = False
    evaluations: Annotated[
        int, typer.Option(metavar="N", help="Evaluations that find the valley of good constants.", min=1, max=100000)
    ] = 300
    samples: Annotated[int, typer.Option(metavar="N", help="Weighted samples of the valley.", min=1, max=200)] = 100
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of the search.", min=0)] = 1


@app.command("twin", short_help="Constants of the 3-D robot from walks.")
@with_options
def twin(options: _TwinOptions) -> None:
    """Constants of the three-dimensional robot from a base series of walks, with their uncertainty.

    The data are the paper's, or your own. Half an hour on two cores; evaluations are kept in the folder, so a search
    that was stopped goes on where it was, and with --force one that has ended goes on with more samples.

    Example: chilopod identify twin my.toml --data mine.toml --out fit
    """
    from chilopod.output import check_folder
    from chilopod.tasks.identify import TWIN_TEMPLATE, BaseSeries, identify_twin

    data, out = options.data, options.out
    if _template(options.template, data, TWIN_TEMPLATE):
        return
    described = options.described
    from chilopod.paper.fit_data import base_series_data

    measured = base_series_data() if data is None else BaseSeries.load(data)
    free(_identified(out), options.force)
    counts = options.evaluations, options.samples
    with progress_bar("identification") as progress:
        kept, step = check_folder(out / "evaluations"), partial(progress, "identification")
        found = identify_twin(described, measured, *counts, options.seed, kept, step)
    result = {"robot": described.name, **found.as_json()}
    lines = [
        *(
            f"{name} = {value['text']}  (90 % of the valley: {value['interval_text']})"
            for name, value in result["constants"].items()
        ),
        *found.words(),
        f"fits and robot file are in {out}",
    ]
    _deliver(options, out, result, found.best, lines)


def _template(wanted: bool, data: Path | None, text: str) -> bool:
    """Print the template of a file of data if it is wanted."""
    if wanted and data is not None:
        raise ParameterError("must not be given with --template", field="--data", value=str(data))
    if wanted:
        typer.echo(text, nl=False)
    return wanted


def _identified(folder: Path) -> tuple[Path, Path]:
    return folder / "identification.json", folder / "identified.toml"


def _deliver(
    options: RobotOptions,
    out: Path,
    result: dict[str, Any],
    best: Robot,
    lines: list[str],
    more: Iterable[tuple[Path, Content]] = (),
) -> None:
    """Write a result, the robot with the best constants and more files, and print it."""
    from chilopod.output import write_all

    texts = json_text(result) + "\n", best.with_(name="identified").to_toml()
    files: Iterable[tuple[Path, Content]] = chain(zip(_identified(out), texts, strict=True), more)
    show = partial(print_json, result) if options.as_json else partial(typer.echo, "\n".join(lines))
    deliver(lambda: write_all(files, replace=options.force), show)
