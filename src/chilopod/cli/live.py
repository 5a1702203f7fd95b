"""``chilopod live``: a robot that walks in the browser."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from chilopod.cli.options import EngineOption, SetOption, read_robot, reading


def _strategies() -> list[str]:
    from chilopod.live.state import STRATEGIES_HERE

    return [each.name for each in STRATEGIES_HERE]


def live(
    robot: Annotated[
        str, typer.Argument(metavar="[ROBOT]", help="A robot file, or one of the presets aoi2022 and aoi2022-planar.")
    ] = "aoi2022-planar",
    engine: EngineOption = "planar",
    strategy: Annotated[
        str,
        typer.Option(
            metavar="variable|leg-yaw|actuated",
            help="How it goes to a target; the page can change it.",
            autocompletion=_strategies,
        ),
    ] = "variable",
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Of the start, and of the nudges of the floor.")] = 1,
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Where to listen: by default for this machine only; 0.0.0.0 lets in everybody who can reach it.",
        ),
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(metavar="N", help="At which port; 0 for any that is free.")] = 8080,
    duration: Annotated[
        str | None, typer.Option(metavar="TIME", help='End by itself after so long, such as "10 min".')
    ] = None,
    browser: Annotated[bool, typer.Option("--open", help="Open it in a browser too.")] = False,
    overrides: SetOption = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FOLDER", help="Keep recordings here too, besides the browser's downloads."),
    ] = None,
) -> None:
    """A robot that walks in the browser, while you change it.

    Drag the first spring below the pitchfork and watch it bend; click on the floor, and it goes there; drag a joint.
    Ctrl-C ends it. Needs: pip install "chilopod[live]".
    """
    from chilopod import units

    described = read_robot(robot, overrides)
    with reading("duration"):
        seconds = None if duration is None else units.parse(duration, "s")
    from chilopod.live import Live

    def keep(name: str, record: bytes, page: str) -> None:
        from chilopod.errors import OutputError
        from chilopod.output import write_all

        assert out is not None
        try:
            for path in write_all([(out / f"{name}.nc", record), (out / f"{name}.html", page)], replace=False):
                typer.echo(f"wrote {path}", err=True)
        except OutputError as error:
            typer.echo(f"error: {error}", err=True)  # and the walk goes on
            raise

    page = Live(
        described, engine, seed=seed, strategy=strategy, host=host, port=port, kept=keep if out is not None else None
    )
    try:
        typer.echo(f"{described.name} walks at {page.address} (Ctrl-C ends it)")
        if browser and not webbrowser.open(page.address):
            typer.echo(f"no browser could be started: open {page.address} in one", err=True)
        page.wait(seconds)
    finally:
        page.close()
