"""``chilopod reproduce`` and ``chilopod identify``: the paper's results, and the constants it does not print."""

from __future__ import annotations

import traceback
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from chilopod.cli.options import (
    ClusterOption,
    ForceOption,
    JsonOption,
    SetOption,
    deliver,
    free,
    json_text,
    new_app,
    print_json,
    read_robot,
    walking_on,
)
from chilopod.cli.progress import progress_bar
from chilopod.paper.registry import REGISTRY, chosen

if TYPE_CHECKING:
    from chilopod.paper.table import RobotRow, Row
    from chilopod.robot import Robot

PRESET, WHOLE = "aoi2022-planar", "aoi2022"

identify_app = new_app("Find constants of a model from measured or printed numbers.")


def reproduce(
    ctx: typer.Context,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="SECTION",
            help=f"Just this section; may be repeated: {', '.join(REGISTRY)}.",
            autocompletion=lambda: list(REGISTRY),
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="FOLDER", help="Where the report goes; one that is there is gone on with.")
    ] = Path("report"),
    quick: Annotated[bool, typer.Option("--quick", help="Coarser sweeps, fewer trials.")] = False,
    tiny: Annotated[
        bool, typer.Option("--tiny", help="Hardly anything of every section: to see that all works, not what it finds.")
    ] = False,
    paper: Annotated[
        bool, typer.Option("--paper", help="The paper's own experiments, not what goes beyond them.")
    ] = False,
    cluster: ClusterOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
    overrides: Annotated[list[str] | None, typer.Option("--set", hidden=True)] = None,
) -> None:
    """Repeat the paper with its planar model and with its robot in 3-D, and write a report beside its own numbers.

    The page is there at once and fills in. Trials are kept in the folder, so a run that was stopped goes on where it
    was. It takes no robot and no --set: the numbers beside which it puts its own are those of the paper's robot.
    """
    if overrides:
        from chilopod.errors import ParameterError

        raise ParameterError(
            "reproduce changes nothing about the robot: the paper's numbers are those of the paper's",
            value=overrides[0],
            allowed="no --set; stability, bifurcation, branch, walk and turn take any robot",
        )
    sections = chosen(only, quick or tiny, paper)  # refuses an unknown section
    from chilopod.errors import OutputError, in_words
    from chilopod.paper import section as computed
    from chilopod.paper.page import Report, check_report
    from chilopod.paper.section import Context, Found, Section, Size

    size = Size.TINY if tiny else Size.QUICK if quick else Size.FULL
    check_report(out, sections, size, replace=force)
    context = Context(read_robot(PRESET, None), read_robot(WHOLE, None), size, out / "trials")
    found, stopped = Found(context), None

    def add(now: Found, section: Section[Any]) -> None:
        nonlocal found
        found = now
        report.add(now, [section])

    try:
        with (
            walking_on(cluster),
            progress_bar("reproduce") as progress,
            Report(sections, context, out, progress) as report,
        ):
            typer.echo(f"The page is {report.page.resolve()}", err=as_json)
            computed.reproduce(sections, context, progress, add)
    except OutputError as error:
        if not found.values:
            raise
        stopped = error  # what was found is printed all the same
    rows, robot_rows = [row for part in found.planar_rows().values() for row in part], found.robot_rows()
    if as_json:
        print_json(
            {
                "robot": context.robot.name,
                "whole_robot": context.whole.name,
                "report": str(report.page),
                "rows": [row.data() for row in rows],
                "robot_rows": [row.data() for row in robot_rows],
                "seconds": {section.name: value for section, value in found.seconds.items()},
                "failures": {section.name: in_words(failure) for section, failure in report.failures.items()},
            }
        )
    else:
        _print(rows, robot_rows, report.page)
    for section, failure in report.failures.items():
        typer.echo(f"failed: {section.sentence}: {in_words(failure)}", err=True)
        if ctx.find_root().params.get("debug"):
            traceback.print_exception(failure)
    if stopped is not None:
        raise stopped
    if report.failures:
        raise typer.Exit(1)


def _print(rows: list[Row], robot_rows: list[RobotRow], page: Path) -> None:
    for row in rows:
        typer.echo(f"{row.verdict:<12} {row.quantity}")
        typer.echo(f"{'':<12}   paper: {row.paper}")
        typer.echo(f"{'':<12}   here:  {row.computed.words}")
    for line in robot_rows:
        typer.echo(f"{line.verdict:<12} {line.quantity} ({line.kind})")
        typer.echo(f"{'':<12}   robot:  {line.robot}")
        if line.twin:
            typer.echo(f"{'':<12}   twin:   {line.twin.words}")
        if line.planar:
            typer.echo(f"{'':<12}   planar: {'; '.join(each.words for each in line.planar)}")
    typer.echo("")
    typer.echo(f"The report is {page}")
    typer.echo("Next, try:")
    for command in (
        "chilopod stability aoi2022-planar",
        'chilopod bifurcation aoi2022-planar --parameter "springs.stiffness[0]" --between "2 N*mm/deg" "75 N*mm/deg"',
        'chilopod turn aoi2022-planar --target "30 deg, 2 m" --out turn',
        "chilopod robot new my.toml --modules 8",
    ):
        typer.echo(f"  {command}")


@identify_app.command(short_help="Constants of the planar model from printed numbers.")
def planar(
    robot: Annotated[str, typer.Argument(metavar="[ROBOT]", help="A robot file or preset.")] = PRESET,
    overrides: SetOption = None,
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where results go.")] = Path("identification"),
    force: ForceOption = False,
    points: Annotated[int, typer.Option(metavar="N", help="Points of the profile.", min=3, max=200)] = 25,
    as_json: JsonOption = False,
) -> None:
    """Friction, half-width and forward offset of the feet from the paper's printed numbers, and how sure they are.

    Writes the profile over the forward offset as a figure and as data, and the robot with the best constants.
    """
    from chilopod.output import write_all

    described = read_robot(robot, overrides)
    from chilopod.paper.fit_data import critical_mode_data, variant_settings
    from chilopod.paper.straight.identification import identification_files
    from chilopod.show import files_of
    from chilopod.tasks.identify import identify_planar

    free([*files_of("identification", out), *_identified(out)], force)
    with progress_bar("identification") as progress:
        found = identify_planar(
            described,
            critical_mode_data(),
            points,
            variant_settings(),
            lambda done, words: progress("identification", done, words),
        )
    result = {"robot": described.name, **found.as_json()}

    def write() -> list[Path]:
        texts = zip(_identified(out), _texts(result, found.best), strict=True)
        return write_all(chain(texts, identification_files(found, out)), replace=force)

    def show() -> None:
        if as_json:
            print_json(result)
            return
        typer.echo("\n".join([*found.lines(), f"profile, figure and robot file are in {out}"]))

    deliver(write, show)


def _identified(folder: Path) -> tuple[Path, Path]:
    return folder / "identification.json", folder / "identified.toml"


def _texts(result: dict[str, Any], best: Robot) -> tuple[str, str]:
    """Texts of the files of :func:`_identified`."""
    return json_text(result) + "\n", best.with_(name="identified").to_toml()


@identify_app.command(short_help="Constants of the 3-D robot from the paper's walks.")
def twin(
    robot: Annotated[str, typer.Argument(metavar="[ROBOT]", help="A robot file or preset with a [twin].")] = WHOLE,
    overrides: SetOption = None,
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where results go.")] = Path(
        "identification-twin"
    ),
    force: ForceOption = False,
    starts: Annotated[int, typer.Option(metavar="N", help="Searches, from different places.", min=1, max=100)] = 3,
    generations: Annotated[
        int, typer.Option(metavar="N", help="Of ten evaluations each, in every search.", min=1, max=1000)
    ] = 14,
    seed: Annotated[int, typer.Option(metavar="N", help="Of the search.", min=0)] = 1,
    fresh: Annotated[bool, typer.Option("--fresh", help="Begin without the constants that are known.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Constants of the three-dimensional robot from the paper's base series of walks, and how sure they are.

    Half an hour on two cores; evaluations are kept in the folder, so a search that was stopped goes on where it
    was, and with --force one that has ended goes on with more. The preset aoi2022 is what this finds by default.
    """
    from chilopod.output import check_folder, write_all

    described = read_robot(robot, overrides)
    free(_identified(out), force)
    from chilopod.paper.fit_data import base_series_data
    from chilopod.tasks.identify import identify_twin

    with progress_bar("identification") as progress:
        found = identify_twin(
            described,
            base_series_data(),
            starts,
            generations,
            seed,
            check_folder(out / "evaluations"),
            fresh,
            lambda done, words: progress("identification", done, words),
        )
    result = {"robot": described.name, **found.as_json()}

    def show() -> None:
        if as_json:
            print_json(result)
            return
        for name, value in result["constants"].items():
            typer.echo(f"{name} = {value['text']}  (fits as good: {value['good_fits_text']})")
        typer.echo(
            f"misfit {result['misfit']:.2f} (1: every datum within 5 %), {result['good']} of {result['evaluations']} "
            "evaluations are below 1"
        )
        typer.echo(f"fits and robot file are in {out}")

    deliver(
        lambda: write_all(zip(_identified(out), _texts(result, found.best), strict=True), replace=force),
        show,
    )
