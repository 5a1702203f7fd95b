"""A recorded walk that plays: in a browser from one file that needs nothing else, in a notebook where it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from html import escape
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod import units
from chilopod.frozen import Array
from chilopod.output import write_atomic
from chilopod.show.scene.frames import LARGEST, Scene, encoded, packed, robot_of, scene
from chilopod.show.scene.outline import SLIMNESS
from chilopod.show.style import SCENE, THIN
from chilopod.show.templates import template

SHOWN: Final = 6
"""Walks of a replay: more are hard to tell apart."""

_HEIGHT: Final = 560  # px, in a notebook
_RATE: Final = 25.0  # Hz; the eye needs no more, and every sample makes the page larger


@dataclass(frozen=True)
class Replay:
    """A page that plays walks, and needs nothing but itself."""

    heading: str  #: of the page
    html: str = field(repr=False)  #: the page

    def write(self, path: str | Path, *, replace: bool = False) -> None:
        """Write the page as a file, which opens from disk; an OutputError if it is there and may not be replaced."""
        write_atomic(Path(path), self.html, replace=replace)

    def _repr_html_(self) -> str:
        # Its scripts may run, but reach nothing of the notebook.
        return (
            f'<iframe srcdoc="{escape(self.html)}" title="{escape(self.heading)}" sandbox="allow-scripts" '
            f'style="width:100%;height:{_HEIGHT}px;border:0"></iframe>'
        )


def replay(
    record: xr.Dataset, *, titles: Mapping[Any, str] | Sequence[str] | None = None, heading: str | None = None
) -> Replay:
    """Let recorded walks play: in three dimensions where the record has poses, seen from above where it has none.

    The page plays at once, unless the reader's system asks for little motion. With an address that ends in ``#t=12.5``
    it waits at that time (s), with ``follow`` it stays close to the robot, and in three dimensions ``view=`` is
    oblique, behind, side or above; ``&`` joins them.

    Parameters
    ----------
    record
        Record of any engine, see :mod:`chilopod.show.scene.frames`.
    titles
        Title of each robot, by its label in the record or in the order there; None: the first six by their numbers.
    heading
        Heading of the page; None: the robot's name.

    Raises
    ------
    ParameterError
        If the record does not go with its robot, or a robot has no title.
    """
    if titles is None:
        record = record.isel(robot=slice(SHOWN))
        titles = [f"walk {i + 1}" for i in range(record.sizes["robot"])]
    if heading is None:
        heading = robot_of(record).name
    time = record["time"].values
    every = max(1, round(1.0 / (_RATE * float(time[1] - time[0])))) if len(time) > 1 else 1
    shown = scene(record, titles, time[::every])
    if "pose" in record:
        from chilopod.show.scene.replay_3d import FINE, solid

        data, words = solid(record, shown), {"fine": f"{shown.floor.grid / FINE:g} m"}
        return Replay(heading, _page("replay_3d.html.j2", shown, heading, "in three dimensions", data, **words))
    return Replay(heading, _page("replay.html.j2", shown, heading, "seen from above", _flat(shown)))


def _page(name: str, shown: Scene, heading: str, view: str, data: Mapping[str, Any], **words: str) -> str:
    """A template with its contents, and the data that its scripts read; they have an entry ``robots`` with one mapping
    a robot."""
    time, floor = shown.frames.time, shown.floor
    panels = [
        {"title": title, "alt": f"{title}: the robot on the floor, {view}. Outcome: {outcome.text}."}
        for title, outcome in zip(shown.titles, shown.outcomes, strict=True)
    ]
    robots = [
        {
            "outcome": asdict(outcome),
            "aims": list(map(asdict, aims)),
            "springs": [encoded(_in_steps(shares)) for shares in springs.T],
            "steers": shown.steers(index),
            **more,
        }
        for index, (outcome, aims, springs, more) in enumerate(
            zip(shown.outcomes, shown.aims, shown.shares.swapaxes(0, 1), data["robots"], strict=True)
        )
    ]
    common = {
        "time": {"start": float(time[0]), "step": float(np.diff(time[:2]).sum()), "count": len(time)},
        "floor": asdict(floor),
        "colors": SCENE,
        "springs": {"thin": THIN, "stiffest": units.from_si(float(np.nanmax(shown.springs, initial=0.0)), "N*mm/deg")},
        "arrivalRadius": shown.arrival_radius,
    }
    said = {"heading": heading, "panels": panels, "colors": SCENE, "grid": f"{floor.grid:g} m", **words}
    data = {**common, **data, "robots": robots}
    return template("chilopod.show.scene", name).render(said, has_targets=any(shown.aims), data=data)


def _in_steps(shares: Array) -> NDArray[np.uint16]:
    """Shares of a spring over time as whole numbers of 16 bits, only one if it does not change."""
    steps = np.rint(65535.0 * np.clip(np.nan_to_num(shares), 0.0, 1.0)).astype("<u2")
    return steps if np.ptp(steps) else steps[:1]


def _flat(shown: Scene) -> dict[str, Any]:
    """Data of walks seen from above; arrays are little-endian, in base64."""
    frames = shown.frames
    robot, count, n = frames.robot, len(frames.time), frames.robot.body.modules
    # First the spine, then left and right foot of every module.
    points = np.concatenate([frames.spine, frames.feet.reshape(count, -1, 2 * n, 2)], axis=2)
    origin, reach = shown.floor.span()
    step = reach / LARGEST
    steps = packed(points, origin, step)
    stands = np.packbits(frames.stands.reshape(count, -1, 2 * n), axis=-1, bitorder="little")
    length = robot.module_length
    return {
        "scale": {"x": float(origin[0]), "y": float(origin[1]), "step": step},
        "body": {"modules": n, "length": length, "width": SLIMNESS * length, "offset": robot.legs.forward_offset},
        "robots": [
            {"points": encoded(steps[:, index]), "stands": encoded(stands[:, index])}
            for index in range(len(shown.titles))
        ],
    }
