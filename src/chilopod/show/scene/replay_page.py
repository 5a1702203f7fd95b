"""Page that all replays have in common: HTML with a panel per robot, and controls to play it."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, Final

import numpy as np
import xarray as xr
from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray

from chilopod.show import style
from chilopod.show.scene.frames import Floor, Scene

LARGEST: Final = 32767
"""Positions are packed as whole numbers of 16 bits, from minus this to this."""

NOWHERE: Final = -32768
"""Stands for NaN among them."""

COLORS: Final = {
    "ink": style.BLACK,
    "grid": "#d4d4d4",
    "body": style.SKY,
    "edge": style.BLUE,
    "air": style.GREY,
    "path": style.ORANGE,
    "target": style.GREEN,
}

_RATE: Final = 25.0  # Hz; the eye needs no more, and every sample makes the page larger


def shown_times(record: xr.Dataset) -> NDArray[np.float64]:
    """Those samples of a record that a replay shows, s."""
    time: NDArray[np.float64] = record["time"].values
    every = max(1, round(1.0 / (_RATE * float(time[1] - time[0])))) if len(time) > 1 else 1
    return time[::every]


def page(
    name: str, shown: Scene, heading: str, view: str, data: Mapping[str, Any], scripts: Sequence[str], **words: Any
) -> str:
    """The HTML.

    Parameters
    ----------
    name
        Name of the template.
    shown
        Walks that are drawn.
    heading
        Heading of the page.
    view
        Description of the view for those who cannot see it.
    data
        Data that its script reads besides those that every kind of replay needs, with an entry ``robots`` of one
        mapping a robot.
    scripts
        Names of files, in the order they are run.
    words
        Other words of the template.
    """
    folder = files("chilopod.show.scene")

    def text(file: str) -> str:
        return folder.joinpath(file).read_text(encoding="utf-8")

    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=FunctionLoader(text),
    )
    return environment.get_template(name).render(
        heading=heading,
        css=Markup(text("replay.css")),
        scripts=[Markup(text(file)) for file in ("replay_player.js", *scripts)],
        panels=[
            {"title": title, "alt": f"{title}: {view}. Outcome: {outcome.text}."}
            for title, outcome in zip(shown.titles, shown.outcomes, strict=True)
        ],
        colors=COLORS,
        grid=f"{shown.floor.grid:g} m",
        has_targets=any(shown.aims),
        data={**_common(shown), **data, "robots": _robots(shown, data["robots"])},
        **words,
    )


def span(floor: Floor) -> tuple[NDArray[np.float64], float]:
    """Middle of the floor and how far packed positions may be from it: the floor, and as far again on every side, m."""
    origin = np.array([0.5 * (floor.x0 + floor.x1), 0.5 * (floor.y0 + floor.y1)])
    return origin, 1.5 * max(floor.x1 - floor.x0, floor.y1 - floor.y0)


def encoded(values: NDArray[Any]) -> str:
    """An array in base64; it should be little-endian."""
    return b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def packed(values: NDArray[np.float64], origin: NDArray[np.float64], step: NDArray[np.float64] | float) -> NDArray[Any]:
    """Whole numbers of steps from an origin, clipped to what they hold."""
    with np.errstate(over="ignore"):
        steps = np.round((values - origin) / step).clip(-LARGEST, LARGEST)
    return np.where(np.isnan(steps), NOWHERE, steps).astype("<i2")


def _common(shown: Scene) -> dict[str, Any]:
    time, floor = shown.frames.time, shown.floor
    return {
        "time": {"start": float(time[0]), "step": float(np.diff(time[:2]).sum()), "count": len(time)},
        "floor": {"x0": floor.x0, "x1": floor.x1, "y0": floor.y0, "y1": floor.y1, "grid": floor.grid},
        "colors": COLORS,
        "arrivalRadius": shown.arrival_radius,
    }


def _robots(shown: Scene, more: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    return [
        {
            "outcome": {"text": outcome.text, "kind": outcome.kind, "time": outcome.time},
            "aims": [{"place": aim.place, "since": aim.since, "reached": aim.reached} for aim in aims],
            **each,
        }
        for outcome, aims, each in zip(shown.outcomes, shown.aims, more, strict=True)
    ]
