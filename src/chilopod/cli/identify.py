"""``chilopod identify``: the constants that the paper does not print, and those of a robot of your own."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from chilopod.cli.commands import new_app
from chilopod.cli.options import RobotOptions, deliver, free, json_text, print_result, with_options
from chilopod.cli.progress import progress_bar
from chilopod.errors import AnalysisError, ChilopodError, ParameterError, UnitError

if TYPE_CHECKING:
    from chilopod.output import Content
    from chilopod.progress import Progress
    from chilopod.tasks import identify

    Found = identify.Identification | identify.RecordedIdentification | identify.TwinIdentification
    More = dict[str, identify.NextMeasurements | identify.SelfTest | "_Nothing"]

app = new_app("Find constants of a model from measured or printed numbers.")


@dataclass(frozen=True)
class _Options(RobotOptions):
    """Argument and options of both commands, as they were typed."""

    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where results go.")] = Path("identification")
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="FILE", help="TOML file of your own data; by default the paper's numbers."),
    ] = None
    template: Annotated[bool, typer.Option("--template", help="Print a file for --data, and end.")] = False

    def printed(self, command: str) -> bool:
        """Print the template of a command if it is wanted."""
        from chilopod.tasks.identify import TEMPLATES

        if self.template and self.data is not None:
            raise ParameterError("must not be given with --template", field="--data", value=str(self.data))
        typer.echo(TEMPLATES[command] if self.template else "", nl=False)
        return self.template

    def identify(self, solve: Callable[[Callable[[str], Progress]], tuple[Found, More]]) -> None:
        """Solve with a progress bar; write the result, the robot with the best constants and the figure, and print."""
        from chilopod.output import write_all
        from chilopod.show import files_of
        from chilopod.show.figures import identification
        from chilopod.show.files import panel_files

        written = self.out / "identification.json", self.out / "identified.toml"
        free([*files_of("identification", self.out), *written], self.force)
        with progress_bar("identification") as progress:
            try:
                found, more = solve(lambda title: partial(progress, title))
            except (AnalysisError, ParameterError, UnitError) as error:
                error.source = error.source or (None if self.data is None else str(self.data))
                raise
        result = {"robot": self.described.name, **found.as_json()}
        result |= {name: each.as_json() for name, each in more.items()}
        lines = [*found.lines(), *(line for each in more.values() for line in each.lines())]
        source = "numbers of Aoi et al. (2022)" if self.data is None else repr(self.data.name)[1:-1]  # printable
        texts = json_text(result) + "\n", found.estimates.identified(source).to_toml()
        figure = panel_files(identification.panel(found), self.out, self.out)
        files: Iterable[tuple[Path, Content]] = chain(zip(written, texts, strict=True), figure)
        deliver(lambda: write_all(files, replace=self.force), lambda: print_result(result, lines, self.as_json))


@dataclass(frozen=True)
class _Nothing:
    """Reason why an identification has no result of an option."""

    option: str
    problem: str

    def as_json(self) -> dict[str, str]:
        return {"problem": self.problem}

    def lines(self) -> list[str]:
        return [f"no result of --{self.option}: {self.problem}"]


_POINTS = 25


@dataclass(frozen=True)
class _PlanarOptions(_Options):
    """Argument and options of ``identify planar``, as they were typed."""

    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="A robot file or preset.")] = "aoi2022-planar"
    points: Annotated[int, typer.Option(metavar="N", help="Number of points of the profile.", min=3, max=200)] = _POINTS
    measure: Annotated[bool, typer.Option("--next", help="Say which measurements would tell most.")] = False
    check: Annotated[
        int, typer.Option("--check", metavar="N", help="Identify N robots whose constants are known.", min=0, max=10000)
    ] = 0


@app.command("planar", short_help="Constants of the planar model from a critical spring and its mode, or from walks.")
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

    if options.printed("planar"):
        return
    from chilopod.paper.printed import critical_mode_data, variant_settings

    robot, given, variants = options.described, options.data, variant_settings() if options.data is None else {}
    kinds = identify.CriticalMode, identify.RecordedWalks
    data = identify.load_data(given, *kinds) if given else critical_mode_data()
    others = {"--next": options.measure, "--check": options.check, "--points": options.points != _POINTS}
    field = next((name for name, on in others.items() if on), "")
    if field and isinstance(data, identify.RecordedWalks):
        raise ParameterError("must not be given with recorded walks", field=field)

    def solve(progress: Callable[[str], Progress]) -> tuple[Found, More]:
        if isinstance(data, identify.RecordedWalks):
            folder = given.parent if given else Path()
            return identify.identify_recorded(robot, data, folder, progress("identification")), {}
        found = identify.identify_planar(robot, data, options.points, variants, progress("identification"))
        asked: dict[str, Callable[..., identify.NextMeasurements | identify.SelfTest]] = {}
        if options.measure:
            asked["next"] = partial(identify.next_measurements, found)
        if options.check:
            asked["check"] = partial(identify.self_test, found.best, data, options.check)
        more: More = {}
        for option, result in asked.items():
            try:
                more[option] = result(progress=progress(f"--{option}"))
            except ChilopodError as error:  # the identification is there without it
                more[option] = _Nothing(option, str(error))
        return found, more

    options.identify(solve)


@dataclass(frozen=True)
class _TwinOptions(_Options):
    """Argument and options of ``identify twin``, as they were typed."""

    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="A robot file or preset with a [twin].")] = "aoi2022"
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where results go.")] = Path(
        "identification-twin"
    )
    evaluations: Annotated[
        int, typer.Option(metavar="N", help="Evaluations that find the valley of good constants.", min=1, max=100000)
    ] = 300
    samples: Annotated[int, typer.Option(metavar="N", help="Weighted samples of the valley.", min=1, max=10_000)] = 100
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of the search.", min=0)] = 1


@app.command("twin", short_help="Constants of the 3-D robot from walks.")
@with_options
def twin(options: _TwinOptions) -> None:
    """Constants of the three-dimensional robot from a base series of walks, with their uncertainty.

    The data are the paper's, or your own. Half an hour on two cores; evaluations are kept in the folder, so a search
    that was stopped goes on where it was, and with --force one that has ended goes on with more samples.

    Example: chilopod identify twin my.toml --data mine.toml --out fit
    """
    from chilopod.tasks import identify

    if options.printed("twin"):
        return
    from chilopod.paper.printed import base_series_data

    robot, given, counts = options.described, options.data, (options.evaluations, options.samples, options.seed)
    data = identify.load_data(given, identify.BaseSeries) if given else base_series_data()
    kept = options.out / "evaluations"
    options.identify(
        lambda progress: (identify.identify_twin(robot, data, *counts, kept, progress("identification")), {})
    )
