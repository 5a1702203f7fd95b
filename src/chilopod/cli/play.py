"""``chilopod play``: a page in which the planar robot walks, with nothing to install."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from chilopod.cli.options import ForceOption, JsonOption, SetOption, free, read_robot, save
from chilopod.cli.progress import progress_bar


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

    The page is one file of about 44 kB. It computes the planar model itself, loads nothing, and opens from disk.

    The address sets the first spring and the seed: play.html?k1=8&seed=2.

    Example: chilopod play aoi2022-planar --out play.html
    """
    from chilopod.show.play import play as page

    described = read_robot(robot, overrides)
    free([out], force, ".html")
    with progress_bar("play") as show:
        html = page(described, lambda done, words: show("branch of curved walks", done, words))
    save(out, html, described, force=force, as_json=as_json)
    if browser:
        webbrowser.open(out.resolve().as_uri())
