"""A place to take pictures of the twin in: its model in colour on a tiled floor in soft light, drawn off-screen.

Dress, floor and light belong to the picture only; shape and joints are those of :mod:`chilopod.twin.model`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import mujoco
import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.robot import Robot
from chilopod.show import style
from chilopod.show.style import SCENE as COLORS
from chilopod.twin.legs import twin_of
from chilopod.twin.model import AWAY, POLE_GROUP, SIDES, build, scanner_place

Pixels = NDArray[np.uint8]

TILE: Final = 0.5
"""Side of the floor's tiles, m."""

_OPENING: Final = math.radians(30.0)  # of the lens, from the bottom of a picture to its top
_AHEAD: Final = np.array([0.0, math.cos(math.radians(40.0)), -math.sin(math.radians(40.0))])
_RIGHT: Final = np.array([1.0, 0.0, 0.0])  # as in a map: x to the right, y up the picture
_LIGHT: Final = np.array([0.25, 0.35, -1.0])
_PALE: Final = 0.4  # what is left of the colours of a robot that no longer walks
_BRIGHT: Final = 0.88  # of the floor, for what is pale
_MOST_PIECES: Final = 2000  # of a path
_PATH_WIDTH: Final = 0.01  # m, and three pixels at least
_FLAT: Final = 0.0005  # m, half the thickness of what lies on the floor
_SHADOW, _DISC, _PATH = 0.001, 0.002, 0.003  # m above the floor, one above the other


@dataclass(frozen=True)
class View:
    """Point at which the lens is aimed, m, shape (3,), and its distance from there, m."""

    middle: Array
    distance: float


def framing(points: ArrayLike, aspect: float) -> View:
    """The nearest view, from above at an angle, that has all points (m, shape (P, 3)) in a picture of this aspect."""
    axes = np.stack([_RIGHT, np.cross(_RIGHT, _AHEAD), _AHEAD])
    across, up, depth = axes @ np.asarray(points, dtype=np.float64).T
    half = math.tan(0.5 * _OPENING)
    # Lines of sight along the picture's four edges: the lens is where the outermost ones meet, and one pair is outer.
    place, back = [], math.inf
    for value, slope in ((across, half * aspect), (up, half)):
        low, high = float((value - slope * depth).max()), float((value + slope * depth).min())
        back = min(back, 0.5 * (high - low) / slope)
        place.append(0.5 * (low + high))
    distance = 0.5 * float(depth.min() + depth.max()) - back
    return View(np.array([*place, back]) @ axes + distance * _AHEAD, distance)


@dataclass(frozen=True)
class Look:
    """Appearance of a robot in a picture."""

    pose: Array | None  # MuJoCo's ``qpos``; None shows the floor alone
    stands: NDArray[np.bool_]  # True for each foot on the floor, (N, 2)
    walks: bool  # False of a robot that has failed: it is pale
    path: Array  # of module 1 so far, m, (P, 2)
    target: Array | None  # its place, m, (2,)
    radius: float  # of arrival, m
    arrived: bool  # True if the target has been reached
    springs: Array  # of the yaw joints, relative to the stiffest of all, (N-1,)


class Studio:
    """Camera for pictures of one size (pixels) and from about one view, within :func:`chilopod.twin.gl.context`; to be
    closed before that. Fine pictures have shadows, which take several times as long; others a patch of shade."""

    def __init__(self, robot: Robot, size: tuple[int, int], view: View, fine: bool = False) -> None:
        self.robot, self.fine = robot, fine
        self.model = _dressed(robot, size, view, fine).compile()
        self.data = mujoco.MjData(self.model)
        count = robot.body.modules
        self.modules = [int(self.model.body(f"module{i + 1}").id) for i in range(count)]
        shins = [[f"leg{i + 1}_{side}_{part}" for part in ("lower", "foot")] for i in range(count) for side in SIDES]
        self.shins = np.array([[self.model.geom(name).id for name in each] for each in shins]).reshape(count, 2, 2)
        self.springs = [int(self.model.geom(f"spring{i}").id) for i in range(1, count)]
        self.thick: Array = self.model.geom_size[self.springs, 0].copy()
        self.of_robot = np.flatnonzero(self.model.body_rootid[self.model.geom_bodyid] == self.modules[0])
        self.colors: Array = self.model.geom_rgba[:, :3].astype(np.float64)
        self.scene = mujoco.MjvScene(self.model, self.model.ngeom + count + _MOST_PIECES + 100)
        self.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = fine
        self.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self.option = mujoco.MjvOption()
        self.option.geomgroup[POLE_GROUP] = True
        self.camera = mujoco.MjvCamera()
        self.camera.azimuth = math.degrees(math.atan2(_AHEAD[1], _AHEAD[0]))
        self.camera.elevation = math.degrees(math.asin(_AHEAD[2]))
        self.rect = mujoco.MjrRect(0, 0, *size)
        self.pixels = np.zeros((size[1], size[0], 3), np.uint8)
        self.context = mujoco.MjrContext(self.model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self.context)

    def close(self) -> None:
        """Release the resources of OpenGL."""
        self.context.free()

    def picture(self, look: Look, view: View) -> Pixels:
        """Pixels of shape (height, width, 3), overwritten by the next; a ParameterError for another robot's pose."""
        model, data, scene = self.model, self.data, self.scene
        if look.pose is not None:
            if look.pose.shape != data.qpos.shape:
                allowed = f"{data.qpos.size} numbers"
                raise ParameterError("does not go with its robot", field="pose", value=look.pose.size, allowed=allowed)
            data.qpos[:] = look.pose
        strength = 1.0 if look.walks else _PALE
        widths, self.colors[self.springs] = style.springs(look.springs)
        model.geom_size[self.springs, 0] = self.thick * widths
        stands, swings = to_rgb(COLORS["ink"]), to_rgb(COLORS["air"])
        self.colors[self.shins] = np.where(look.stands[..., None, None], stands, swings)
        model.geom_rgba[self.of_robot, :3] = (_BRIGHT + strength * (self.colors - _BRIGHT))[self.of_robot]
        model.geom_rgba[self.of_robot, 3] = look.pose is not None
        data.mocap_pos[0] = AWAY if look.target is None else (*look.target, 0.0)
        model.light_pos[0] = view.middle - view.distance * _LIGHT
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        self.camera.lookat[:], self.camera.distance = view.middle, view.distance
        mujoco.mjv_updateScene(model, data, self.option, None, self.camera, mujoco.mjtCatBit.mjCAT_ALL, scene)
        if not self.fine and look.pose is not None:
            self._shade(strength)
        if look.target is not None:
            disc = (*to_rgb(COLORS["target"]), 0.55 if look.arrived else 0.25)
            self._lay(mujoco.mjtGeom.mjGEOM_CYLINDER, look.target, _DISC, (look.radius, _FLAT, 0.0), 0.0, disc)
        pixel = 2.0 * view.distance * math.tan(0.5 * _OPENING) / self.rect.height
        self._trace(look.path, max(_PATH_WIDTH, 3.0 * pixel))
        mujoco.mjr_render(self.rect, scene, self.context)
        mujoco.mjr_readPixels(self.pixels, None, self.rect, self.context)
        return self.pixels[::-1]

    def _shade(self, strength: float) -> None:
        twin = twin_of(self.robot)
        half = (0.46 * self.robot.module_length, 0.5 * twin.body_width, _FLAT)
        for body in self.modules:
            place, turn = self.data.xpos[body], self.data.xmat[body]
            at = place[:2] - place[2] * _LIGHT[:2] / _LIGHT[2]
            yaw = math.atan2(turn[3], turn[0])
            self._lay(mujoco.mjtGeom.mjGEOM_BOX, at, _SHADOW, half, yaw, (0.0, 0.0, 0.0, 0.16 * strength))

    def _trace(self, path: Array, width: float) -> None:
        """A band along a path."""
        path = path[np.isfinite(path).all(axis=-1)]
        if len(path) < 2:
            return
        gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
        pieces = min(_MOST_PIECES, math.ceil(gone[-1] / (2.0 * width)))
        # Of the samples, so that a piece that is drawn stays where it is while the path grows.
        picked = np.unique(np.searchsorted(gone, 2.0 * width * np.arange(pieces)).clip(0, len(path) - 1))
        corners = path[np.append(picked, len(path) - 1)]
        ink = (*to_rgb(COLORS["path"]), 1.0)
        for start, step in zip(corners[:-1], np.diff(corners, axis=0), strict=True):
            half = (0.5 * math.hypot(*step) + 0.2 * width, 0.5 * width, _FLAT)
            self._lay(mujoco.mjtGeom.mjGEOM_BOX, start + 0.5 * step, _PATH, half, math.atan2(step[1], step[0]), ink)

    def _lay(
        self, kind: Any, at: Array, above: float, size: Sequence[float], yaw: float, rgba: Sequence[float]
    ) -> None:
        """Put something flat on the floor."""
        scene = self.scene
        if scene.ngeom >= scene.maxgeom:
            return
        cos, sin = math.cos(yaw), math.sin(yaw)
        turn = np.array([cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0])
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, kind, np.array(size), np.array([*at, above]), turn, np.array(rgba, np.float32))
        geom.specular = 0.0
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR
        scene.ngeom += 1


def _dressed(robot: Robot, size: tuple[int, int], view: View, fine: bool) -> Any:
    """The robot's description for pictures."""
    spec = build(robot)
    look = spec.visual
    look.global_.offwidth, look.global_.offheight = size
    look.global_.fovy = math.degrees(_OPENING)
    look.quality.offsamples = 4
    look.quality.shadowsize = 4096
    if not fine:  # sides of what is round: the usual 28 and 16 take half as long again
        look.quality.numslices, look.quality.numstacks = 20, 5
    # Lengths in units of the extent.
    spec.stat.extent = view.distance
    look.map.znear, look.map.zfar, look.map.shadowclip = 0.05, 8.0, 0.7
    # What shines from the lens and what comes from above add up to 1 on the floor, so that colours stay as they are.
    look.headlight.ambient, look.headlight.diffuse, look.headlight.specular = [0.45] * 3, [0.15] * 3, [0.0] * 3
    light: dict[str, Any] = {"ambient": [0.0] * 3, "diffuse": [0.5] * 3, "specular": [0.1] * 3}
    above = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    spec.worldbody.add_light(type=above, dir=_LIGHT, castshadow=fine, **light)
    checker, flat = mujoco.mjtBuiltin.mjBUILTIN_CHECKER, mujoco.mjtBuiltin.mjBUILTIN_FLAT
    tile: dict[str, Any] = {"rgb1": to_rgb("#e9eaec"), "rgb2": to_rgb("#dcdee1"), "width": 512, "height": 512}
    tile |= {"mark": mujoco.mjtMark.mjMARK_EDGE, "markrgb": to_rgb("#c6c9cd")}
    floor = spec.add_texture(name="tiles", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=checker, **tile)
    sky: dict[str, Any] = {"rgb1": to_rgb("#f4f5f7"), "rgb2": to_rgb("#f4f5f7"), "width": 16, "height": 96}
    spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=flat, **sky)
    # Two by two tiles make the texture, which MuJoCo repeats that many times on 2 m.
    tiles = spec.add_material(name="tiles", texuniform=True, texrepeat=[1.0 / TILE] * 2, specular=0.0, shininess=0.0)
    tiles.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = floor.name
    for geom in spec.geoms:
        if geom.name == "floor":
            geom.material = tiles.name
        elif geom.name == "pole":
            geom.rgba = [*to_rgb(COLORS["target"]), 1.0]
        elif geom.name.endswith("_box"):
            geom.rgba = [*to_rgb(COLORS["edge" if geom.name == "module1_box" else "body"]), 1.0]
        elif geom.name.endswith("_upper"):
            geom.rgba = [*to_rgb(COLORS["ink"]), 1.0]
    _add_dress(spec, robot)
    return spec


def _add_dress(spec: Any, robot: Robot) -> None:
    """Visible details of the robot: joints between the modules, drives of the legs, the scanner."""
    twin, ink = twin_of(robot), [*to_rgb(COLORS["ink"]), 1.0]
    length, inner, outer = robot.module_length, 0.4 * twin.body_width, robot.legs.half_width
    box, cylinder = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER
    for i in range(robot.body.modules):
        body = spec.body(f"module{i + 1}")
        if i:
            size = [0.2 * twin.body_width, 0.56 * twin.body_height, 0.0]
            body.add_geom(name=f"spring{i}", type=cylinder, size=size, pos=[0.5 * length, 0.0, 0.0], rgba=ink)
        for side in (1.0, -1.0):
            size = [0.07 * length, 0.5 * abs(outer - inner), 0.2 * twin.body_height]
            place = [robot.legs.forward_offset, 0.5 * side * (outer + inner), 0.0]
            body.add_geom(type=box, size=size, pos=place, rgba=ink)
    front, (x, y, z) = spec.body("module1"), scanner_place(twin)
    radius, top = 0.25 * twin.body_width, 0.5 * twin.body_height
    rise = z - top
    front.add_geom(type=cylinder, size=[radius, 0.7 * rise, 0.0], pos=[x, y, top + 0.7 * rise], rgba=ink)
    band = [*to_rgb(style.PALE), 1.0]
    front.add_geom(type=cylinder, size=[1.02 * radius, 0.2 * rise, 0.0], pos=[x, y, z], rgba=band)
