"""The robot, the floor, the way it came and the target in the browser's three-dimensional picture.

Everything is made once; a frame only moves it. The picture is cheap enough for a browser that draws without a graphics
card: shadows are flat boxes, and the floor is one small picture without light, which costs a tenth of a shaded one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray

from chilopod.frozen import Array
from chilopod.live.body import KINDS, Placed
from chilopod.live.state import Seen
from chilopod.robot import Robot
from chilopod.show.style import SCENE, springs
from chilopod.steering import ARRIVAL_RADIUS

WORLD = "/world"
_TILES = 12  # each way, an even number
_TILE = 0.25  # side of a tile over the length of the robot
_PIXELS = 16  # of a side of a tile
_TILE_COLORS, _SHADE = ("#f6f7f8", "#e4e7ea"), "#bcc1c7"
_SHADOW, _ON_FLOOR = 0.002, 0.004  # m above the floor: shadows; paths and targets
_WAY = 300  # points of the way that it came
_EYE = np.array([-0.5, -0.68, 0.68])  # place of the eye over the length of the robot
_NARROW = 1.3  # width of a picture over its height below which the eye moves back


def _rgb(color: str) -> tuple[int, int, int]:
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def _lit(color: str) -> NDArray[np.uint8]:
    """A colour of a mesh in light, which is taken for the part of the light that comes back."""
    return np.rint(255.0 * (np.array(_rgb(color)) / 255.0) ** 2.2).astype(np.uint8)


_COLORS = {"box": _lit(SCENE["body"]), "rod": _lit(SCENE["air"]), "ball": _lit("#ffffff"), "pin": _lit(SCENE["spring"])}
_FRONT, _STANDING, _TARGET = (_lit(SCENE[name]) for name in ("edge", "ink", "target"))


class View:
    """View in three dimensions of a robot of a file, and the first positions of its parts."""

    def __init__(self, server: viser.ViserServer, placed: Mapping[str, Placed], file: Robot) -> None:
        length, self._stiffest = file.body.length, max(file.springs.stiffness)
        scene = server.scene
        scene.world_axes.visible = False
        scene.configure_default_lights(True, cast_shadow=False)
        self.follow = True
        self._tile = _TILE * length
        self._world = scene.add_frame(WORLD, show_axes=False)
        side = _TILES * self._tile
        self._floor = scene.add_image(f"{WORLD}/floor", _tiles(), side, side, cast_shadow=False, receive_shadow=False)
        self._batches = {kind: _add(scene, kind, kind, placed[kind], _COLORS[kind]) for kind in KINDS}
        self.pins = self._batches["pin"]  #: the yaw joints, which can be dragged
        self._batches["box"].batched_colors = np.stack([_FRONT, *[_COLORS["box"]] * (len(placed["box"].centres) - 1)])
        flat = placed["box"].scales * (1.0, 1.0, 0.0) + (0.0, 0.0, 1e-4)
        self._shadows = _add(scene, "shadows", "box", replace(placed["box"], scales=flat), _lit(_SHADE))
        self._way = scene.add_line_segments(
            f"{WORLD}/way", np.zeros((_WAY - 1, 2, 3)), _rgb(SCENE["path"]), thickness=2.5, thickness_units="screen"
        )
        self._points: deque[Array] = deque(maxlen=_WAY)
        self._apart = 0.02 * length
        pole = np.array([[ARRIVAL_RADIUS, ARRIVAL_RADIUS, 0.002], [0.01, 0.01, 0.3]])
        upright = Placed(np.zeros((2, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)), pole)
        self._target = _add(scene, "target", "pin", upright, _TARGET, opacity=0.6, visible=False)
        self._eye = length * _EYE
        server.initial_camera.position, server.initial_camera.look_at = tuple(self._eye), (0.0, 0.0, 0.0)

    @property
    def origin(self) -> Array:
        """Position of the floor's origin in the picture, m, (3,)."""
        return np.array(self._world.position)

    def fit(self, camera: viser.CameraHandle) -> None:
        """Move the eye of a browser back where its picture is too narrow for the robot."""
        camera.position = tuple(self._eye * max(1.0, _NARROW / camera.aspect))
        camera.look_at = (0.0, 0.0, 0.0)  # which moves along with the position

    def forget(self) -> None:
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
        self._dress(placed["pin"], seen)
        self._shade(placed["box"])
        centre = placed["box"].centres.mean(axis=0)
        centre[2] = 0.0
        self._floor.position = np.round(centre / (2.0 * self._tile)) * 2.0 * self._tile
        self._world.position = -centre if self.follow else np.zeros(3)
        self._show_way(placed["box"].centres[0])
        if seen.target is not None:
            x, y = seen.target
            self._target.batched_positions = np.array([[x, y, _ON_FLOOR], [x, y, 0.15]], dtype=np.float32)
        self._target.visible = seen.target is not None

    def _dress(self, pins: Placed, seen: Seen) -> None:
        """Springs thin and light when soft, and standing feet dark."""
        gait, feet = seen.robot.gait, self._batches["ball"]
        widths, colors = springs(seen.stiffness / self._stiffest)
        _update(self.pins, "batched_scales", (pins.scales * widths[:, None] ** np.array([1, 1, 0])).astype(np.float32))
        _update(self.pins, "batched_colors", np.rint(255.0 * colors**2.2).astype(np.uint8))
        stands = gait.stands(gait.phases(seen.clock, seen.robot.body.modules) % 1.0).ravel()
        _update(feet, "batched_colors", np.where(stands[:, None], _STANDING, _COLORS["ball"]).astype(np.uint8))

    def _shade(self, boxes: Placed) -> None:
        """Shadows below the modules, straight down."""
        places, (w, z) = boxes.centres.copy(), (boxes.turns[:, 0], boxes.turns[:, 3])
        places[:, 2] = _SHADOW
        about_z = np.stack([w, 0 * w, 0 * w, z], axis=1) / np.maximum(np.hypot(w, z), 1e-9)[:, None]
        self._shadows.batched_positions = places.astype(np.float32)
        self._shadows.batched_wxyzs = about_z.astype(np.float32)

    def _show_way(self, front: Array) -> None:
        point = np.array([front[0], front[1], _ON_FLOOR])
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


def _update(handle: Any, name: str, value: NDArray[Any]) -> None:
    """Send a property to browsers if it has changed."""
    if not np.array_equal(getattr(handle, name), value):
        setattr(handle, name, value)


def _tiles() -> NDArray[np.uint8]:
    """Picture of the floor, which fades towards its edges."""
    pixels = _TILES * _PIXELS
    rows, columns = np.indices((pixels, pixels))
    colors = np.array([_rgb(color) for color in _TILE_COLORS])[(rows // _PIXELS + columns // _PIXELS) % 2]
    away = np.hypot(rows + 0.5 - 0.5 * pixels, columns + 0.5 - 0.5 * pixels) / (0.5 * pixels)
    seen = 255.0 * np.clip((1.0 - away) / 0.3, 0.0, 1.0)
    return np.concatenate([colors, seen[..., None]], axis=2).astype(np.uint8)


def _add(scene: viser.SceneApi, name: str, kind: str, placed: Placed, color: NDArray[np.uint8], **look: Any) -> Any:
    """Parts of a kind in one colour, as one object of the picture."""
    if kind == "box":
        shape = trimesh.creation.box()
    elif kind == "ball":
        shape = trimesh.creation.icosphere(subdivisions=1)
    else:
        shape = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=16)
    return scene.add_batched_meshes_simple(
        f"{WORLD}/{name}",
        *(shape.vertices, shape.faces, placed.turns, placed.centres),
        batched_scales=placed.scales,
        batched_colors=np.tile(color, (len(placed.centres), 1)),
        flat_shading=name == "box",
        **{"lod": "off", "cast_shadow": False, "receive_shadow": False, **look},
    )
