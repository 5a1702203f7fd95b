"""``chilopod reproduce``: the paper's results beside its own numbers."""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from chilopod.cli.options import ForceOption, JsonOption, print_result, read_robot, with_options
from chilopod.cli.progress import progress_bar
from chilopod.cli.walking import ClusterOption, walking_on
from chilopod.errors import OutputError, ParameterError, in_words
from chilopod.paper.registry import REGISTRY, chosen

if TYPE_CHECKING:
    from chilopod.paper.page import Report
    from chilopod.paper.section import Found, Section, Size

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
    Path, typer.Option("--out", metavar="FOLDER", help="Folder of the report; the trials that it keeps are read.")
]
TinyOption = Annotated[
    bool, typer.Option("--tiny", help="Smallest size of every section, to test that all run; the results mean nothing.")
]
AllOption = Annotated[bool, typer.Option("--all", help="Every study beyond the paper, with all trials: an hour.")]
QuickOption = Annotated[bool, typer.Option("--quick", help="The paper's main experiments: three minutes.")]
PaperOption = Annotated[bool, typer.Option("--paper", help="The paper's own experiments, not what goes beyond them.")]

_NEXT = (
    "  chilopod stability aoi2022-planar",
    '  chilopod bifurcation aoi2022-planar --parameter "springs.stiffness[0]" --between "2 N*mm/deg" "75 N*mm/deg"',
    '  chilopod turn aoi2022-planar --target "30 deg, 2 m" --out turn',
    "  chilopod robot new my.toml --modules 8",
)


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
    folder. After a stop the same command begins the page anew, reads them, and computes the rest again: two minutes
    with --quick, three by default. It takes no robot and no --set, because the paper's numbers hold for its own robot
    only.

    Example: chilopod reproduce --quick --out report
    """
    if options.overrides:
        problem = "must not be given, because the paper's numbers are those of its own robot"
        allowed = "no --set; stability, bifurcation, branch, walk and turn take any robot"
        raise ParameterError(problem, field="--set", value=options.overrides[0], allowed=allowed)
    from chilopod.paper.section import Size

    sizes = {"--all": options.everything, "--quick": options.quick, "--tiny": options.tiny}
    if sum(sizes.values()) > 1:
        given = " ".join(name for name, on in sizes.items() if on)
        raise ParameterError("must be given alone", field="size", value=given, allowed="one of --all, --quick, --tiny")
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
        raise typer.Exit(2 if all(isinstance(each, OutputError) for each in report.failures.values()) else 1)


def _computed(
    options: ReportOptions, sections: list[Section[Any]], size: Size
) -> tuple[Found, Report, Exception | None]:
    """Results, their report, and the error that stopped the work, if one did."""
    from chilopod.paper import section as computed
    from chilopod.paper.ahead import Studio, walked_ahead
    from chilopod.paper.duration import plan
    from chilopod.paper.page import Report, check_report
    from chilopod.paper.section import Context, Found

    check_report(options.out, sections, size, replace=options.force)
    context = Context(read_robot("aoi2022-planar", None), read_robot("aoi2022", None), size, options.out / "trials")
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
            Report(sections, context, options.out, progress, said, Studio()) as report,
        ):
            typer.echo(said.words(), err=options.as_json)
            typer.echo(f"The page is {report.page.resolve()}", err=options.as_json)
            # A cluster walks everything.
            with walked_ahead([] if options.cluster else sections, context) as ready:
                computed.reproduce(sections, context, progress, add, ready)
    except OutputError as error:
        if not found.values:
            raise
        stopped = error  # what was found is printed all the same
    return found, report, stopped


def _print(options: ReportOptions, found: Found, report: Report) -> None:
    rows, robot_rows = [row for part in found.planar_rows().values() for row in part], found.robot_rows()
    result = {
        "robot": found.context.robot.name,
        "whole_robot": found.context.whole.name,
        "report": str(report.page),
        "rows": [row.data() for row in rows],
        "robot_rows": [row.data() for row in robot_rows],
        "seconds": {section.name: value for section, value in found.seconds.items()},
        "failures": {section.name: in_words(failure) for section, failure in report.failures.items()},
    }
    lines: list[str] = []
    for row in rows:
        lines += _of_row(row.verdict, row.quantity, {"paper": row.paper, "here": row.computed.words})
    for line in robot_rows:
        said = {name: line.data()[name] for name in ("robot", "twin", "planar")}
        lines += _of_row(line.verdict, f"{line.quantity} ({line.kind})", said)
    print_result(result, [*lines, f"\nThe report is {report.page}\nNext, try:", *_NEXT], options.as_json)


def _of_row(verdict: str, quantity: str, said: dict[str, str]) -> list[str]:
    width = max(map(len, said)) + 1
    return [f"{verdict:<12} {quantity}", *(f"{'':<12}   {who + ':':<{width}} {x}" for who, x in said.items() if x)]
