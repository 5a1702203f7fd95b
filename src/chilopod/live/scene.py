"""The robot, the floor, the way it came and the target in the browser's three-dimensional picture.

Everything is made once; a frame only moves it. The picture is cheap enough for a browser that draws without a graphics
card: no shadows, and the floor is a few lines, as a shaded one costs more than all the rest.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray

from chilopod.frozen import Array
from chilopod.live.body import KINDS, Placed
from chilopod.live.state import Seen
from chilopod.show.style import BLACK, BLUE, GREY, ORANGE, SKY, VERMILLION
from chilopod.steering import ARRIVAL_RADIUS

WORLD = "/world"
_FLOOR_LINES = 9  # each way
_WAY = 300  # points of the way that it came
_UPRIGHT = np.array([[1.0, 0.0, 0.0, 0.0]])


def _rgb(color: str) -> tuple[int, int, int]:
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def _lit(color: str) -> NDArray[np.uint8]:
    """A colour of a mesh in light, which is taken for the part of the light that comes back."""
    return np.rint(255.0 * (np.array(_rgb(color)) / 255.0) ** 2.2).astype(np.uint8)


_COLORS = {"box": _lit(SKY), "rod": _lit(GREY), "ball": _lit(BLACK), "pin": _lit(ORANGE)}
_FRONT = _lit(VERMILLION)


class View:
    """View in three dimensions of a robot with a length (m) and the first positions of its parts."""

    def __init__(self, server: viser.ViserServer, placed: Mapping[str, Placed], length: float) -> None:
        scene = server.scene
        scene.world_axes.visible = False
        scene.configure_default_lights(True, cast_shadow=False)
        self.follow = True
        self._step = 0.5 * length
        self._world = scene.add_frame(WORLD, show_axes=False)
        self._floor = scene.add_line_segments(
            f"{WORLD}/floor", _lines(self._step, _FLOOR_LINES), (205, 205, 205), thickness=1.0, thickness_units="screen"
        )
        plain: dict[str, Any] = {"lod": "off", "cast_shadow": False, "receive_shadow": False}
        self._batches = {
            kind: scene.add_batched_meshes_simple(
                f"{WORLD}/{kind}",
                *_mesh(kind),
                placed[kind].turns,
                placed[kind].centres,
                batched_scales=placed[kind].scales,
                batched_colors=_colors(kind, len(placed[kind].centres)),
                flat_shading=kind == "box",
                **plain,
            )
            for kind in KINDS
        }
        self._way = scene.add_line_segments(
            f"{WORLD}/way", np.zeros((_WAY - 1, 2, 3)), _rgb(BLUE), thickness=2.0, thickness_units="screen"
        )
        self._points: deque[Array] = deque(maxlen=_WAY)
        self._apart = 0.02 * length
        self._target = scene.add_batched_meshes_simple(
            f"{WORLD}/target",
            *_mesh("pin"),
            np.tile(_UPRIGHT, (2, 1)),
            np.zeros((2, 3)),
            batched_scales=np.array([[ARRIVAL_RADIUS, ARRIVAL_RADIUS, 0.002], [0.01, 0.01, 0.3]]),
            batched_colors=np.tile(_FRONT, (2, 1)),
            opacity=0.6,
            visible=False,
            **plain,
        )
        server.initial_camera.position = (-0.9 * length, -1.0 * length, 0.9 * length)
        server.initial_camera.look_at = (0.1 * length, 0.0, 0.0)

    @property
    def pins(self) -> Any:
        """The yaw joints, which can be dragged."""
        return self._batches["pin"]

    @property
    def origin(self) -> Array:
        """Position of the floor's origin in the picture, m, (3,)."""
        return np.array(self._world.position)

    def forget_way(self) -> None:
        """Forget the path."""
        self._points.clear()

    def show(self, placed: Mapping[str, Placed], seen: Seen) -> None:
        """Move everything to where it is now; all of it appears at once if this is within ``server.atomic()``."""
        if not np.isfinite(seen.pose).all():
            return  # it stays where it was seen last
        for kind, batch in self._batches.items():
            here = placed[kind]
            batch.batched_positions = here.centres.astype(np.float32)
            batch.batched_wxyzs = here.turns.astype(np.float32)
            if kind == "rod":
                batch.batched_scales = here.scales.astype(np.float32)
        centre = placed["box"].centres.mean(axis=0)
        centre[2] = 0.0
        self._floor.position = np.round(centre / self._step) * self._step
        self._world.position = -centre if self.follow else np.zeros(3)
        self._show_way(placed["box"].centres[0])
        if seen.target is not None:
            x, y = seen.target
            self._target.batched_positions = np.array([[x, y, 0.001], [x, y, 0.15]], dtype=np.float32)
        self._target.visible = seen.target is not None

    def _show_way(self, front: Array) -> None:
        point = np.array([front[0], front[1], 0.002])
        if self._points and np.hypot(*(point - self._points[-1])[:2]) < self._apart:
            return
        self._points.append(point)
        points = np.array([self._points[0]] * (_WAY - len(self._points)) + list(self._points))
        self._way.points = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)


def floor_place(origin: Array, start: tuple[float, ...], direction: tuple[float, ...]) -> tuple[float, float] | None:
    """Place where a ray of sight meets the floor with this origin, m; None if the ray does not go down."""
    if not direction[2] < 0.0:
        return None
    reach = (origin[2] - start[2]) / direction[2]
    x, y = (start[axis] + reach * direction[axis] - origin[axis] for axis in (0, 1))
    return float(x), float(y)


def _lines(step: float, count: int) -> Array:
    at = step * (np.arange(count) - count // 2)
    end = np.full(count, at[-1])
    along = np.stack([np.stack([at, -end, 0 * at], axis=1), np.stack([at, end, 0 * at], axis=1)], axis=1)
    return np.concatenate([along, along[:, :, [1, 0, 2]]])


def _mesh(kind: str) -> tuple[Any, Any]:
    if kind == "box":
        shape = trimesh.creation.box()
    elif kind == "ball":
        shape = trimesh.creation.icosphere(subdivisions=1)
    else:
        shape = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=16)
    return shape.vertices, shape.faces


def _colors(kind: str, count: int) -> NDArray[np.uint8]:
    colors = np.tile(_COLORS[kind], (count, 1))
    if kind == "box":
        colors[0] = _FRONT
    return colors
