"""Picture of a robot of a batch from above, in the style of films: one panel, in which only moving parts are
redrawn."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.typing import NDArray

from chilopod.frozen import Array
from chilopod.gym.episodes import Episodes, Moment
from chilopod.show.scene.film import PIXEL, FilmPanel
from chilopod.show.scene.frames import Aim, BodyFrames, Floor, Outcome, Scene, bodies
from chilopod.steering import ARRIVAL_RADIUS

SIZE: Final = 480
"""Height and width of a picture, pixels."""

_FONT, _MARGIN = 14.0, 0.3  # pixels; m


class Picture:
    """Pictures of one robot of a batch during its episodes."""

    def __init__(self, episodes: Episodes, robot: int) -> None:
        self._episodes, self._robot = episodes, robot
        self._figure = Figure(figsize=(SIZE / PIXEL, SIZE / PIXEL), dpi=PIXEL)
        self._canvas: Any = FigureCanvasAgg(self._figure)  # matplotlib does not say what its methods take and give
        self._drawn: tuple[Floor, tuple[Aim, ...]] | None = None

    def drawn(self) -> NDArray[np.uint8]:
        """Picture of the robot now, shape (:data:`SIZE`, :data:`SIZE`, 3); an empty floor before the first episode."""
        moments = self._episodes.moments
        past = list(moments)[-1 - self._episodes.steps(self._robot) :] if moments else []
        if not past:
            return np.full((SIZE, SIZE, 3), 255, dtype=np.uint8)
        frames, aims = self._frames(past), _aims([each.aims[self._robot] for each in past], self._episodes.period)
        floor, springs = self._floor(frames, aims), np.stack([each.stiffness[self._robot, None] for each in past])
        scene = Scene(frames, floor, ("",), (Outcome("", "ended", np.inf),), (aims,), ARRIVAL_RADIUS, springs)
        if self._drawn != (floor, aims):
            self._lay(scene)
            self._drawn = floor, aims
        self._panel.shown = scene
        self._canvas.restore_region(self._background)
        for artist in self._panel.placed(len(frames.time) - 1):
            artist.draw(self._canvas.get_renderer())
        return np.array(self._canvas.buffer_rgba())[..., :3]

    def _frames(self, past: list[Moment]) -> BodyFrames:
        one = slice(self._robot, self._robot + 1)
        pose = np.stack([each.pose[one] for each in past])
        bends, yaws = (np.stack([getattr(each, name)[one] for each in past]) for name in ("joint_angles", "leg_yaw"))
        times = np.arange(len(past), dtype=np.float64) * self._episodes.period
        return bodies(self._episodes.robot, times, pose[..., :2], pose[..., 2], bends, yaws)

    def _floor(self, frames: BodyFrames, aims: tuple[Aim, ...]) -> Floor:
        """Piece of floor of the last picture, if everything is on it; else a larger square."""
        spine, places = frames.spine.reshape(-1, 2), np.array([each.place for each in aims]).reshape(-1, 2)
        spine = spine[np.isfinite(spine).all(axis=1)]
        points = np.concatenate([spine, places - ARRIVAL_RADIUS, places + ARRIVAL_RADIUS])
        low, high = points.min(axis=0), points.max(axis=0)
        last = self._drawn[0] if self._drawn else None
        # A new episode begins where its robot is large enough to be seen.
        if last and len(frames.time) > 1 and (low > (last.x0, last.y0)).all() and (high < (last.x1, last.y1)).all():
            return last
        middle, half = 0.5 * (low + high), 0.5 * float((high - low).max()) + _MARGIN
        return Floor(middle[0] - half, middle[0] + half, middle[1] - half, middle[1] + half, 1.0)

    def _lay(self, scene: Scene) -> None:
        """Draw the floor and its targets, as a background of the robot."""
        self._figure.clear()
        axes: Axes = self._figure.add_axes((0.0, 0.0, 1.0, 1.0))
        zoom = SIZE / (scene.floor.x1 - scene.floor.x0)
        self._panel = FilmPanel(scene, 0, axes, zoom, _FONT, Text())
        self._panel.tell(scene.frames.time[-1])
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(self._figure.bbox)


def _aims(places: list[Array], period: float) -> tuple[Aim, ...]:
    """Targets so far, in their order."""
    aims: list[Aim] = []
    for step, place in enumerate(places):
        where = float(place[0]), float(place[1])
        if np.isfinite(place[0]) and not (aims and aims[-1].place == where):
            aims.append(Aim(where, step * period, None))
    return tuple(aims)
