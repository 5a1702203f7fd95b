"""A recorded walk that plays: in a browser from one file, in a notebook where it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any, Final

import xarray as xr

from chilopod.output import write_atomic
from chilopod.show.scene.frames import robot_of
from chilopod.show.scene.replay import replay as from_above
from chilopod.show.scene.replay_3d import replay_3d

SHOWN: Final = 6
"""Walks of a replay: more are hard to tell apart."""

_HEIGHT: Final = 560  # px, in a notebook


@dataclass(frozen=True)
class Replay:
    """A page that plays walks, and needs nothing but itself.

    Attributes
    ----------
    heading
        Heading of the page.
    html
        The page.
    """

    heading: str
    html: str = field(repr=False)

    def write(self, path: str | Path, *, replace: bool = False) -> None:
        """Write the page as a file, which opens from disk.

        Raises
        ------
        OutputError
            If it cannot be written, or is there and may not be replaced.
        """
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

    Parameters
    ----------
    record
        Record of any engine, see :mod:`chilopod.show.scene.frames`.
    titles
        Title of each robot: by its label in the record, or in the order of the record; None: by their numbers, the
        first six of them.
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
    page_of = replay_3d if "pose" in record else from_above
    return Replay(heading, page_of(record, titles=titles, heading=heading))
