"""``chilopod live`` and ``chilopod play``: a robot that walks in the browser, and a page in which it does so alone."""

from __future__ import annotations

import math
import webbrowser
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from chilopod.cli import options as shared
from chilopod.cli.options import EngineOption, ForceOption, JsonOption, RobotArg, SetOption, choices, with_options
from chilopod.cli.progress import progress_bar
from chilopod.errors import OutputError, ParameterError, concerning
from chilopod.live.ports import check_port
from chilopod.live.wishes import LARGEST_SEED

if TYPE_CHECKING:
    from chilopod.live import Live


StrategyOption = Annotated[
    str,
    typer.Option(help="Strategy at the start; the page can change it.", autocompletion=lambda: choices("ON_THE_WAY")),
]


@dataclass(frozen=True)
class LiveOptions:
    """Argument and options of ``live``, as they were typed."""

    robot: RobotArg = "aoi2022-planar"
    engine: EngineOption = "planar"
    strategy: StrategyOption = "variable"
    seed: Annotated[
        int,
        typer.Option(metavar="N", min=0, max=LARGEST_SEED, help="Seed of the start and of the nudges of the floor."),
    ] = 1
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address to listen at, by default for this machine only. At any other address, such as 0.0.0.0 "
            "(all), a browser needs the token in the printed link.",
        ),
    ] = "127.0.0.1"
    port: Annotated[int, typer.Option(metavar="N", help="Port to listen at; 0 for any free port.")] = 8080
    token: Annotated[
        bool, typer.Option("--token", help="Require the token on this machine too, where others use it as well.")
    ] = False
    duration: Annotated[
        str | None, typer.Option(metavar="TIME", help='Time after which the page ends by itself, such as "10 min".')
    ] = None
    browser: Annotated[bool, typer.Option("--open", help="Open the page in a browser too.")] = False
    overrides: SetOption = None
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FOLDER", help="Folder for recordings, besides the downloads of the browser."),
    ] = None
    force: ForceOption = False


@with_options
def live(options: LiveOptions) -> None:
    """Show a robot that walks in the browser while you change it.

    Drag the first spring below the pitchfork and the robot bends; click on the floor and it goes there; drag a joint.
    Requests of other web sites are refused. Ctrl-C ends the page and keeps a recording that is under way. Needs: pip
    install "chilopod[live]".

    Example: chilopod live aoi2022-planar --set "springs.stiffness[0]=15 N*mm/deg" --open
    """
    out, time = options.out, options.duration
    seconds = math.inf if time is None else shared.quantity("duration", time, "s")
    if not seconds > 0.0:
        raise ParameterError("must be a time to walk", field="duration", value=seconds, allowed="more than 0 s")
    check_port(options.port)
    if out is not None:
        earlier = out.glob("chilopod-live-*") if out.is_dir() else ()
        with concerning("--out"):
            shared.free([*_files(out, "chilopod-live-1"), *earlier], options.force)
    described = shared.read_robot(options.robot, options.overrides)
    from chilopod.live import Live

    class Page(Live):
        def listens(self) -> None:
            typer.echo(f"{described.name} walks at {self.address} (Ctrl-C ends it)")
            if options.browser and not webbrowser.open(self.address):
                typer.echo(f"no browser could be started: open {self.address} in one", err=True)

    named = {name: getattr(options, name) for name in ("engine", "seed", "strategy", "host", "port", "token")}
    with progress_bar("live"):
        page = Page(described, **named, kept=None if out is None else partial(_keep, out, options.force))
    try:
        page.wait(seconds)
    finally:
        _end(page, options.force)


def _keep(folder: Path, replace: bool, name: str, record: bytes, page: str) -> None:
    from chilopod.output import write_all

    try:
        for path in write_all(zip(_files(folder, name), (record, page), strict=True), replace=replace):
            typer.echo(f"wrote {path}", err=True)
    except OutputError as error:
        typer.echo(f"error: {error}", err=True)  # and the walk goes on
        raise


def _end(page: Live, replace: bool) -> None:
    page.close()
    for recording in page.undelivered:  # better here than nowhere
        with suppress(OutputError):
            _keep(Path(), replace, *recording)
    if page.gate.refused:
        typer.echo(f"requests and messages that the page refused: {page.gate.refused}", err=True)


def _files(folder: Path, name: str) -> list[Path]:
    return [folder / f"{name}.nc", folder / f"{name}.html"]


def play(
    robot: Annotated[
        str, typer.Argument(metavar="ROBOT", help="Robot file, or the preset aoi2022-planar.")
    ] = "aoi2022-planar",
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="HTML file to write.")] = Path("play.html"),
    browser: Annotated[bool, typer.Option("--open", help="Open the page in a browser too.")] = False,
    overrides: SetOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a page in which the planar robot walks in any browser: drag its first spring, click the floor.

    The page is one file of about 45 kB. It computes the planar model itself, loads nothing, and opens from disk.

    The address sets the first spring and the seed: play.html?k1=8&seed=2.

    Example: chilopod play aoi2022-planar --out play.html
    """
    from chilopod.show.play import play as page

    described = shared.read_robot(robot, overrides)
    with concerning("--out"):
        shared.free([out], force, ".html")
    with progress_bar("play") as show:
        html = page(described, lambda done, words: show("branch of curved walks", done, words))
    shared.save(out, html, described, force=force, as_json=as_json)
    if browser:
        webbrowser.open(out.resolve().as_uri())
