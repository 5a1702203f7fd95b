"""Walks of the twin in three dimensions: films of walks side by side, and stills of their moments.

Both take a record as described in :mod:`chilopod.show.scene.frames` that has ``pose`` as well, from
:func:`chilopod.twin.simulate` with ``poses=True``. Both need OpenGL, see :mod:`chilopod.twin.gl`; a caller that gets
their OutputError without it still has :class:`chilopod.show.scene.film.Film`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import product
from typing import Any, Final

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.typing import ArrayLike

from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.show import style
from chilopod.show.scene.film import APART, CALM, GAP, PIXEL, Film, FilmPanel, Stage
from chilopod.show.scene.frames import Scene, places_of, scene
from chilopod.show.scene.stage_3d import TILE, Look, Studio, View, framing
from chilopod.twin import gl

_TALL: Final = 0.15  # m above the floor that pictures leave room for, more than any robot's back
_BESIDE: Final = 0.1  # m to the side of the middle of the body, likewise
_POLE: Final = 0.42  # m, likewise for the pole
_PICTURE: Final = (640, 400)
_MOST_PICTURES: Final = 60
_NARROWEST, _LOWEST = 120, 80


@dataclass(frozen=True)
class Film3D(Film):
    """Film of walks of the twin; errors are those of :class:`chilopod.show.scene.film.Film`, a ParameterError if the
    record has no poses, and an OutputError if there is no OpenGL."""

    size: tuple[int, int] = (1440, 400)

    @contextmanager
    def _stage(self, times: Array) -> Iterator[Stage]:
        walks = _Walks(self.record, self.titles, times)
        with gl.context(*self.size), style.house_style():
            stage = _Stage3D(self, walks)
            with closing(stage.studio):
                yield stage


def stills(record: xr.Dataset, times: ArrayLike, *, titles: Mapping[Any, str] | Sequence[str]) -> bytes:
    """Moments of walks (s, shape (T,)) as pictures in one PNG, all of the same piece of floor; a row for every robot.
    The nearest samples are shown.

    Raises a ParameterError if a time is not in the record, there are too many, or the record is refused by
    :class:`Film3D`, and an OutputError if there is no OpenGL.
    """
    wanted, recorded = np.atleast_1d(np.asarray(times, dtype=np.float64)), record["time"].values
    robots = record.sizes["robot"]
    if not 1 <= wanted.size * robots <= _MOST_PICTURES:
        allowed = f"1 to {_MOST_PICTURES} pictures in all"
        raise ParameterError("has too few or too many", field="times", value=wanted.size, allowed=allowed)
    outside = ~((wanted >= recorded[0] - 1e-9) & (wanted <= recorded[-1] + 1e-9))
    if outside.any():
        allowed = f"{recorded[0]:g} to {recorded[-1]:g} s"
        value = float(wanted[outside][0])
        raise ParameterError("must be a time of the record", field="times", value=value, allowed=allowed)
    walks = _Walks(record, titles, wanted)
    robot, view = walks.shown.frames.robot, walks.view(_PICTURE)
    with gl.context(*_PICTURE), style.house_style(), closing(Studio(robot, _PICTURE, view, fine=True)) as studio:
        return style.png(_arranged(walks, studio, view), dpi=PIXEL)


class _Walks:
    """Samples of a record nearest to some times."""

    def __init__(self, record: xr.Dataset, titles: Mapping[Any, str] | Sequence[str], times: Array) -> None:
        if "pose" not in record:
            allowed = "one of the twin, simulated with poses=True"
            raise ParameterError("has no poses to draw", field="record", allowed=allowed)
        recorded = record["time"].values.astype(np.float64)
        place = np.interp(times, recorded, np.arange(len(recorded)))
        self.samples = np.ceil(place - 0.5 - 1e-9).astype(np.intp)  # in the middle the earlier one
        self.shown: Scene = scene(record, titles, recorded[self.samples])
        self.poses: Array = record["pose"].transpose("time", "robot", "coordinate").values
        self.positions: Array = record["position"].transpose("time", "robot", "axis").values
        known = np.isfinite(self.poses).all(axis=-1)
        self.last = np.maximum.accumulate(np.where(known, np.arange(len(recorded))[:, None], -1), axis=0)

    def view(self, size: tuple[int, int], robot: int | None = None, index: int = 0) -> View:
        """View of everything, or of the surroundings of a robot at a time."""
        frames, floor = self.shown.frames, self.shown.floor
        if robot is not None:
            around = slice(max(0, index - CALM), index + CALM + 1)
            middle = frames.spine[around, robot].mean(axis=(0, 1))
            reach = 0.55 * frames.robot.body.length
            places = middle + reach * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
        else:
            path = self.positions[: self.samples.max() + 1]
            places = np.concatenate([frames.spine.reshape(-1, 2), path.reshape(-1, 2)])
            low, high = np.array([floor.x0, floor.y0]), np.array([floor.x1, floor.y1])
            # A robot that diverged may be anywhere; the floor is where the others are.
            places = places[np.isfinite(places).all(axis=-1)]
            places = places[((places >= low) & (places <= high)).all(axis=-1)]
        if not len(places) or not np.isfinite(places).all():
            places = np.array([[floor.x0, floor.y0], [floor.x1, floor.y1]])
        beside = _BESIDE * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
        solid = [np.concatenate([_at(places + each, 0.0), _at(places + each, _TALL)]) for each in beside]
        targets = places_of(self.shown.aims)
        if robot is None:
            solid += [_at(targets + self.shown.arrival_radius * each, 0.0) for each in np.sign(beside)]
            solid += [_at(targets, _POLE)]
        return framing(np.concatenate(solid), size[0] / size[1])

    def look(self, index: int, robot: int) -> Look:
        """Look of a robot at a time."""
        shown, sample = self.shown, int(self.samples[index])
        last, now = int(self.last[sample, robot]), float(shown.frames.time[index])
        begun = shown.begun(robot, now)
        return Look(
            pose=self.poses[last, robot] if last >= 0 else None,
            stands=shown.frames.stands[index, robot],
            walks=bool(shown.frames.walks[index, robot]) or shown.outcomes[robot].kind != "stopped",
            path=self.positions[: last + 1, robot],
            target=np.array(begun[-1].place) if begun else None,
            radius=shown.arrival_radius,
            arrived=bool(begun) and begun[-1].is_reached(now),
            springs=shown.shares[index, robot],
        )


class _Stage3D(Stage):
    """A film's heading, clock and key around panels in three dimensions."""

    def __init__(self, film: Film3D, walks: _Walks) -> None:
        self.walks = walks
        self.studio: Studio
        super().__init__(film, walks.shown)
        note = self._text(self.size[0] - GAP, GAP, f"tiles of {TILE:g} m", ha="right", fontsize=0.85 * self.font)
        renderer = self.canvas.get_renderer()
        key = self.figure.legends[0].get_window_extent(renderer)
        note.set_visible(bool(note.get_window_extent(renderer).x0 > key.x1 + self.font))

    def _layout(self, width: float, height: float, longest: float) -> tuple[float, float, int, int]:
        count, robot = len(self.shown.titles), self.shown.frames.robot
        # Side by side as long as panels are not too narrow, then in rows that are as full as can be.
        rows = math.ceil(count / 3)
        columns = math.ceil(count / rows)
        across = max(_NARROWEST, int((width - APART * (columns - 1)) / columns))
        lines = 1 if longest <= across else 2
        tall = max(_LOWEST, int((height - GAP * (rows - 1)) / rows - self._tall(lines)))
        self.studio = Studio(robot, (across, tall), self.walks.view((across, tall), 0 if self.follow else None))
        return across, tall, columns, lines

    def _panel(self, index: int, at: tuple[float, float], size: tuple[float, float], outcome: Text) -> FilmPanel:
        corner = (round(at[0]), round(self.size[1] - at[1]))
        return _Panel3D(self, index, (int(size[0]), int(size[1])), corner, outcome)


class _Panel3D(FilmPanel):
    """One robot in its piece of floor."""

    def __init__(
        self, stage: _Stage3D, robot: int, size: tuple[int, int], corner: tuple[int, int], label: Text
    ) -> None:
        self.stage, self.shown, self.robot, self.size, self.label = stage, stage.shown, robot, size, label
        self.outcome, self.outcome_text, self.rings = stage.shown.outcomes[robot], label.get_text(), []
        (left, above), (width, height) = corner, size
        self.box = (slice(above, above + height), slice(left, left + width), slice(0, 3))
        self.whole = stage.walks.view(size)
        self.index = 0

    def placed(self, index: int) -> Sequence[Any]:
        """Objects to draw at a time."""
        self.index = index
        return (self,)

    def draw(self, renderer: Any) -> None:
        """Put the picture into the frame as it is; matplotlib would take as long as OpenGL to place it."""
        walks, follow = self.stage.walks, self.stage.follow
        view = walks.view(self.size, self.robot, self.index) if follow else self.whole
        picture = self.stage.studio.picture(walks.look(self.index, self.robot), view)
        frame = np.asarray(renderer.buffer_rgba())[self.box]
        frame[:] = picture[: frame.shape[0], : frame.shape[1]]


def _arranged(walks: _Walks, studio: Studio, view: View) -> Figure:
    """Pictures in rows under their captions."""
    shown, size = walks.shown, _PICTURE
    count, robots = len(walks.samples), len(shown.titles)
    font = max(12.0, size[0] / 32.0)
    caption, above = 1.7 * font, 0.5 * GAP
    width = count * (size[0] + GAP) + GAP
    height = robots * (size[1] + caption) + above + GAP
    figure = Figure(figsize=(width / PIXEL, height / PIXEL), dpi=PIXEL)
    for robot, index in product(range(robots), range(count)):
        x = GAP + index * (size[0] + GAP)
        y = height - above - robot * (size[1] + caption)
        says = f"{shown.frames.time[index]:.1f} s"
        title = shown.titles[robot] if index == 0 else ""
        figure.text(x / width, (y - 0.3 * font) / height, title, fontsize=font, weight="bold", va="top")
        figure.text((x + size[0]) / width, (y - 0.3 * font) / height, says, fontsize=font, va="top", ha="right")
        picture = studio.picture(walks.look(index, robot), view).copy()
        figure.figimage(picture, round(x), round(y - caption - size[1]))
    return figure


def _at(places: Array, height: float) -> Array:
    """Places on the floor (P, 2) at a height."""
    return np.column_stack([places, np.full(len(places), height)])
