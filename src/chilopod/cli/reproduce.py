"""``chilopod reproduce`` and ``chilopod identify``: the paper's results, and the constants it does not print."""

from __future__ import annotations

import traceback
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from chilopod.cli.commands import new_app
from chilopod.cli.options import (
    ClusterOption,
    ForceOption,
    JsonOption,
    SetOption,
    deliver,
    free,
    json_text,
    print_json,
    read_robot,
    walking_on,
    with_options,
)
from chilopod.cli.progress import progress_bar
from chilopod.errors import ParameterError
from chilopod.paper.registry import REGISTRY, chosen

if TYPE_CHECKING:
    from chilopod.output import Content
    from chilopod.paper.page import Report
    from chilopod.paper.section import Found, Section, Size
    from chilopod.robot import Robot
    from chilopod.tasks.identify import NextMeasurements, SelfTest

    Files = Iterable[tuple[Path, bytes]]

PRESET, WHOLE = "aoi2022-planar", "aoi2022"

identify_app = new_app("Find constants of a model from measured or printed numbers.")


OnlyOption = Annotated[
    list[str] | None,
    typer.Option(
        "--only",
        metavar="SECTION",
        help=f"Just this section; may be repeated: {', '.join(REGISTRY)}.",
        autocompletion=lambda: list(REGISTRY),
    ),
]
ReportOption = Annotated[
    Path, typer.Option("--out", metavar="FOLDER", help="Folder of the report; an existing report is continued.")
]
TinyOption = Annotated[
    bool, typer.Option("--tiny", help="Smallest size of every section, to test that all run; the results mean nothing.")
]
AllOption = Annotated[bool, typer.Option("--all", help="Every study beyond the paper, with all trials: an hour.")]
QuickOption = Annotated[bool, typer.Option("--quick", help="The paper's main experiments: three minutes.")]
PaperOption = Annotated[bool, typer.Option("--paper", help="The paper's own experiments, not what goes beyond them.")]


@dataclass(frozen=True)
class ReportOptions:
    """Options of ``reproduce``, as they were typed."""

    only: OnlyOption = None
    out: ReportOption = Path("report")
    everything: AllOption = False
    quick: QuickOption = False
    tiny: TinyOption = False
    paper: PaperOption = False
    cluster: ClusterOption = None
    force: ForceOption = False
    as_json: JsonOption = False
    overrides: Annotated[list[str] | None, typer.Option("--set", hidden=True)] = None


@with_options
def reproduce(options: ReportOptions, ctx: typer.Context) -> None:
    """Repeat the paper with its planar model and with its robot in 3-D, and write a report beside its own numbers.

    By default it has the paper's own experiments and one headline of every chapter beyond them, which takes ten
    minutes; the first line says how long it takes here. The page is there at once and fills in. Trials are kept in the
    folder, so a run that was stopped goes on where it was. It takes no robot and no --set, because the paper's
    numbers hold for its own robot only.

    Example: chilopod reproduce --quick --out report
    """
    if options.overrides:
        problem = "must not be given, because the paper's numbers are those of its own robot"
        allowed = "no --set; stability, bifurcation, branch, walk and turn take any robot"
        raise ParameterError(problem, field="--set", value=options.overrides[0], allowed=allowed)
    from chilopod.errors import in_words
    from chilopod.paper.section import Size

    size = Size.FULL if options.everything or options.only else Size.MAIN
    size = Size.TINY if options.tiny else Size.QUICK if options.quick else size
    sections = chosen(options.only, size, options.paper)  # refuses an unknown section
    found, report, stopped = _computed(options, sections, size)
    _print(options, found, report)
    for section, failure in report.failures.items():
        typer.echo(f"failed: {section.sentence}: {in_words(failure)}", err=True)
        if ctx.find_root().params.get("debug"):
            traceback.print_exception(failure)
    if stopped is not None:
        raise stopped
    if report.failures:
        raise typer.Exit(1)


def _computed(
    options: ReportOptions, sections: list[Section[Any]], size: Size
) -> tuple[Found, Report, Exception | None]:
    """Results, their report, and the error that stopped the work, if one did."""
    from chilopod.errors import OutputError
    from chilopod.paper import section as computed
    from chilopod.paper.duration import plan
    from chilopod.paper.page import Report, check_report
    from chilopod.paper.section import Context, Found

    check_report(options.out, sections, size, replace=options.force)
    context = Context(read_robot(PRESET, None), read_robot(WHOLE, None), size, options.out / "trials")
    found, stopped = Found(context), None
    said = plan(sections, size, options.only is not None or options.paper)

    def add(now: Found, section: Section[Any]) -> None:
        nonlocal found
        found = now
        report.add(now, [section])

    try:
        with (
            walking_on(options.cluster),
            progress_bar("reproduce") as progress,
            Report(sections, context, options.out, progress, said) as report,
        ):
            typer.echo(said.words(), err=options.as_json)
            typer.echo(f"The page is {report.page.resolve()}", err=options.as_json)
            computed.reproduce(sections, context, progress, add)
    except OutputError as error:
        if not found.values:
            raise
        stopped = error  # what was found is printed all the same
    return found, report, stopped


def _print(options: ReportOptions, found: Found, report: Report) -> None:
    from chilopod.errors import in_words

    rows, robot_rows = [row for part in found.planar_rows().values() for row in part], found.robot_rows()
    if options.as_json:
        print_json(
            {
                "robot": found.context.robot.name,
                "whole_robot": found.context.whole.name,
                "report": str(report.page),
                "rows": [row.data() for row in rows],
                "robot_rows": [row.data() for row in robot_rows],
                "seconds": {section.name: value for section, value in found.seconds.items()},
                "failures": {section.name: in_words(failure) for section, failure in report.failures.items()},
            }
        )
        return
    for row in rows:
        _print_row(row.verdict, row.quantity, {"paper": row.paper, "here": row.computed.words})
    for line in robot_rows:
        said = {name: line.data()[name] for name in ("robot", "twin", "planar")}
        _print_row(line.verdict, f"{line.quantity} ({line.kind})", said)
    typer.echo(f"\nThe report is {report.page}\nNext, try:")
    for command in (
        "chilopod stability aoi2022-planar",
        'chilopod bifurcation aoi2022-planar --parameter "springs.stiffness[0]" --between "2 N*mm/deg" "75 N*mm/deg"',
        'chilopod turn aoi2022-planar --target "30 deg, 2 m" --out turn',
        "chilopod robot new my.toml --modules 8",
    ):
        typer.echo(f"  {command}")


def _print_row(verdict: str, quantity: str, said: dict[str, str]) -> None:
    typer.echo(f"{verdict:<12} {quantity}")
    width = max(map(len, said)) + 1
    for who, words in said.items():
        if words:
            typer.echo(f"{'':<12}   {who + ':':<{width}} {words}")


@identify_app.command(short_help="Constants of the planar model from a critical spring and its mode.")
def planar(
    robot: Annotated[str, typer.Argument(metavar="[ROBOT]", help="A robot file or preset.")] = PRESET,
    overrides: SetOption = None,
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where results go.")] = Path("identification"),
    force: ForceOption = False,
    points: Annotated[int, typer.Option(metavar="N", help="Number of points of the profile.", min=3, max=200)] = 25,
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="FILE", help="TOML file of your own data; by default the paper's numbers."),
    ] = None,
    template: Annotated[bool, typer.Option("--template", help="Print a file for --data, and end.")] = False,
    measure: Annotated[bool, typer.Option("--next", help="Say which measurements would tell most.")] = False,
    check: Annotated[
        int, typer.Option("--check", metavar="N", help="Identify N robots whose constants are known.", min=0, max=10000)
    ] = 0,
    as_json: JsonOption = False,
) -> None:
    """Friction, half-width and forward offset of the feet from the critical k1 and its mode, with their uncertainty.

    Writes the profile over the forward offset as a figure and as data, and the robot with the best constants. The
    data are the numbers that the paper prints, or your own. --next ranks measurements by what they would leave of the
    uncertainty. --check makes up N robots around the answer and counts how often the ranges cover their constants.

    Example: chilopod identify planar --data mine.toml --out identification
    """
    from chilopod.tasks.identify import TEMPLATE, CriticalMode, identify_planar, next_measurements, self_test

    if template:
        if data is not None:
            raise ParameterError("must not be given with --template", field="--data", value=str(data))
        typer.echo(TEMPLATE, nl=False)
        return
    described = read_robot(robot, overrides)
    from chilopod.paper.fit_data import critical_mode_data, variant_settings
    from chilopod.show import files_of
    from chilopod.show.figures import identification
    from chilopod.show.files import panel_files

    measured, variants = (critical_mode_data(), variant_settings()) if data is None else (CriticalMode.load(data), {})

    free([*files_of("identification", out), *_identified(out)], force)
    with progress_bar("identification") as progress:
        found = identify_planar(described, measured, points, variants, partial(progress, "identification"))
        more: dict[str, NextMeasurements | SelfTest] = {}
        if measure:
            more["next"] = next_measurements(found, progress=partial(progress, "next measurements"))
        if check:
            more["check"] = self_test(found.best, measured, check, progress=partial(progress, "self-test"))
    lines = [
        *found.lines(),
        *(line for each in more.values() for line in each.lines()),
        f"profile, figure and robot file are in {out}",
    ]
    result = {"robot": described.name, **found.as_json(), **{name: each.as_json() for name, each in more.items()}}
    files = panel_files(identification.panel(found), out, out)
    _deliver(out, result, found.best, lines, files, force=force, as_json=as_json)


def _identified(folder: Path) -> tuple[Path, Path]:
    return folder / "identification.json", folder / "identified.toml"


def _deliver(
    out: Path, result: dict[str, Any], best: Robot, lines: list[str], more: Files = (), *, force: bool, as_json: bool
) -> None:
    """Write a result, the robot with the best constants and more files, and print it."""
    from chilopod.output import write_all

    texts = json_text(result) + "\n", best.with_(name="identified").to_toml()
    files: Iterable[tuple[Path, Content]] = chain(zip(_identified(out), texts, strict=True), more)
    show = partial(print_json, result) if as_json else partial(typer.echo, "\n".join(lines))
    deliver(lambda: write_all(files, replace=force), show)


@identify_app.command(short_help="Constants of the 3-D robot from the paper's walks.")
def twin(
    robot: Annotated[str, typer.Argument(metavar="[ROBOT]", help="A robot file or preset with a [twin].")] = WHOLE,
    overrides: SetOption = None,
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where results go.")] = Path(
        "identification-twin"
    ),
    force: ForceOption = False,
    starts: Annotated[int, typer.Option(metavar="N", help="Number of searches.", min=1, max=100)] = 3,
    generations: Annotated[
        int, typer.Option(metavar="N", help="Generations in a search, of ten evaluations each.", min=1, max=1000)
    ] = 14,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of the search.", min=0)] = 1,
    fresh: Annotated[bool, typer.Option("--fresh", help="Begin without the constants that are known.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Constants of the three-dimensional robot from the paper's base series of walks, with their uncertainty.

    Half an hour on two cores; evaluations are kept in the folder, so a search that was stopped goes on where it
    was, and with --force one that has ended goes on with more. The preset aoi2022 is what this finds by default.

    Example: chilopod identify twin aoi2022 --starts 1 --out fit
    """
    from chilopod.output import check_folder

    described = read_robot(robot, overrides)
    free(_identified(out), force)
    from chilopod.paper.fit_data import base_series_data
    from chilopod.tasks.identify import identify_twin

    with progress_bar("identification") as progress:
        kept, step = check_folder(out / "evaluations"), partial(progress, "identification")
        found = identify_twin(described, base_series_data(), starts, generations, seed, kept, fresh, step)
    result = {"robot": described.name, **found.as_json()}
    constants = result["constants"].items()
    lines = [
        *(
            f"{name} = {value['text']}  (fits that meet all data: {value['good_fits_text']})"
            for name, value in constants
        ),
        found.words(),
        f"fits and robot file are in {out}",
    ]
    _deliver(out, result, found.best, lines, force=force, as_json=as_json)
