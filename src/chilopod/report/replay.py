"""A recorded walk as one HTML page that plays it and needs nothing else."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, Final

import numpy as np
import xarray as xr
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray

from chilopod.report import style
from chilopod.report.body import SLIMNESS
from chilopod.report.frames import Floor, Scene, scene

_RATE: Final = 25.0  # Hz; the eye needs no more, and every sample makes the page larger
_LARGEST: Final = 32767
_NOWHERE: Final = -32768  # stands for NaN
COLORS: Final = {
    "ink": style.BLACK,
    "grid": "#d4d4d4",
    "body": style.SKY,
    "edge": style.BLUE,
    "air": style.GREY,
    "path": style.ORANGE,
    "target": style.GREEN,
}


def replay(record: xr.Dataset, *, titles: Mapping[Any, str] | Sequence[str], heading: str) -> str:
    """The record as a page: one panel per robot, seen from above, with controls to play it.

    The page opens from disk. It plays at once, unless the reader's system asks for little motion; with an address that
    ends in ``#t=12.5`` it waits at that time (s).

    Parameters
    ----------
    record
        As described in :mod:`chilopod.report.frames`; more than about six robots are hard to tell apart.
    titles
        What to call each robot: by its label in the record, or in the order of the record.
    heading
        Of the page.

    Returns
    -------
    str
        The HTML.

    Raises
    ------
    ParameterError
        If the record does not go with its robot, or a robot has no title.
    """
    time = record["time"].values
    every = max(1, round(1.0 / (_RATE * float(time[1] - time[0])))) if len(time) > 1 else 1
    shown = scene(record, titles, time[::every])
    folder = files("chilopod.report")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(folder.joinpath("replay.html.j2").read_text(encoding="utf-8"))
    return template.render(
        heading=heading,
        css=Markup(folder.joinpath("replay.css").read_text(encoding="utf-8")),
        script=Markup(folder.joinpath("replay.js").read_text(encoding="utf-8")),
        panels=[
            {"title": title, "alt": f"{title}: the robot on the floor, seen from above. Outcome: {outcome.text}."}
            for title, outcome in zip(shown.titles, shown.outcomes, strict=True)
        ],
        colors=COLORS,
        grid=f"{shown.floor.grid:g} m",
        has_targets=bool(np.isfinite(shown.targets).all(-1).any()),
        data=_data(shown),
    )


def _data(shown: Scene) -> dict[str, Any]:
    """What the script of the page reads; its arrays are little-endian, in base64."""
    frames, floor = shown.frames, shown.floor
    robot, count, n = frames.robot, len(frames.time), frames.robot.body.modules
    # First the spine, then left and right foot of every module.
    points = np.concatenate([frames.spine, frames.feet.reshape(count, -1, 2 * n, 2)], axis=2)
    origin, step = _scale(floor)
    with np.errstate(over="ignore"):
        steps = np.round((points - origin) / step).clip(-_LARGEST, _LARGEST)
    steps[np.isnan(steps)] = _NOWHERE
    stands = np.packbits(frames.stands.reshape(count, -1, 2 * n), axis=-1, bitorder="little")
    return {
        "time": {"start": float(frames.time[0]), "step": float(np.diff(frames.time[:2]).sum()), "count": count},
        "floor": {"x0": floor.x0, "x1": floor.x1, "y0": floor.y0, "y1": floor.y1, "grid": floor.grid},
        "scale": {"x": float(origin[0]), "y": float(origin[1]), "step": step},
        "body": {
            "modules": n,
            "length": robot.module_length,
            "width": SLIMNESS * robot.module_length,
            "offset": robot.legs.forward_offset,
        },
        "colors": COLORS,
        "arrivalRadius": shown.arrival_radius,
        "robots": [
            {
                "outcome": {"text": outcome.text, "kind": outcome.kind, "time": outcome.time},
                "target": target.tolist() if np.isfinite(target).all() else None,
                "points": _encoded(steps[:, index].astype("<i2")),
                "stands": _encoded(stands[:, index]),
            }
            for index, (outcome, target) in enumerate(zip(shown.outcomes, shown.targets, strict=True))
        ],
    }


def _scale(floor: Floor) -> tuple[NDArray[np.float64], float]:
    """Middle of the floor and the step (m) of whole numbers that reach as far again as the floor on every side."""
    origin = np.array([0.5 * (floor.x0 + floor.x1), 0.5 * (floor.y0 + floor.y1)])
    return origin, 1.5 * max(floor.x1 - floor.x0, floor.y1 - floor.y0) / _LARGEST


def _encoded(values: NDArray[Any]) -> str:
    return b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
