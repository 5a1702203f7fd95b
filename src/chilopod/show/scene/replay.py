"""A recorded walk as one HTML page that plays it and needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from chilopod.show.scene.frames import Scene, scene
from chilopod.show.scene.outline import SLIMNESS
from chilopod.show.scene.replay_page import COLORS, LARGEST, encoded, packed, page, shown_times, span

__all__ = ["COLORS", "replay"]


def replay(record: xr.Dataset, *, titles: Mapping[Any, str] | Sequence[str], heading: str) -> str:
    """The record as a page: one panel per robot, seen from above, with controls to play it.

    The page opens from disk. It plays at once, unless the reader's system asks for little motion; with an address that
    ends in ``#t=12.5`` it waits at that time (s), with ``#t=12.5&follow`` close to the robot.

    Parameters
    ----------
    record
        As described in :mod:`chilopod.show.scene.frames`; more than about six robots are hard to tell apart.
    titles
        Title of each robot: by its label in the record, or in the order of the record.
    heading
        Heading of the page.

    Returns
    -------
    str
        The HTML.

    Raises
    ------
    ParameterError
        If the record does not go with its robot, or a robot has no title.
    """
    shown = scene(record, titles, shown_times(record))
    view = "the robot on the floor, seen from above"
    return page("replay.html.j2", shown, heading, view, _data(shown), ["replay.js"])


def _data(shown: Scene) -> dict[str, Any]:
    """Data that the script of the page reads; its arrays are little-endian, in base64."""
    frames = shown.frames
    robot, count, n = frames.robot, len(frames.time), frames.robot.body.modules
    # First the spine, then left and right foot of every module.
    points = np.concatenate([frames.spine, frames.feet.reshape(count, -1, 2 * n, 2)], axis=2)
    origin, reach = span(shown.floor)
    step = reach / LARGEST
    steps = packed(points, origin, step)
    stands = np.packbits(frames.stands.reshape(count, -1, 2 * n), axis=-1, bitorder="little")
    return {
        "scale": {"x": float(origin[0]), "y": float(origin[1]), "step": step},
        "body": {
            "modules": n,
            "length": robot.module_length,
            "width": SLIMNESS * robot.module_length,
            "offset": robot.legs.forward_offset,
        },
        "robots": [
            {"points": encoded(steps[:, index]), "stands": encoded(stands[:, index])}
            for index in range(len(shown.titles))
        ],
    }
