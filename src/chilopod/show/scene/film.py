"""A recorded walk as an mp4 film, drawn like the replay."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass
from itertools import chain
from typing import Any, Final

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.image import imsave
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from numpy.typing import NDArray

from chilopod import units
from chilopod.errors import OutputError, ParameterError
from chilopod.frozen import Array
from chilopod.kinematics import from_modules
from chilopod.show import style
from chilopod.show.scene.encoder import ENCODER, encoded, has_encoder
from chilopod.show.scene.frames import Floor, Scene, close, scene
from chilopod.show.scene.outline import SLIMNESS
from chilopod.show.style import SCENE as COLORS
from chilopod.show.words import spring

CALM: Final = 12
"""Frames before and after over which a camera that follows is held."""
SPRING: Final = "N*mm/deg"
_SMALLEST, LARGEST = 240, 4096
_SLOWEST, FASTEST = 0.01, 1000.0  # s of a walk in one of a film
PIXEL: Final = 72.0  # points in an inch: at so many dots per inch, matplotlib's sizes are pixels
GAP: Final = 12.0  # to the edges and from row to row, pixels
APART: Final = 28.0  # from column to column: outcome and next title stand side by side
_MARKS: Final = {"arrived": ("✓ ", "#00563f"), "stopped": ("✕ ", "#8f3d00"), "ended": ("", style.BLACK)}


@dataclass(frozen=True)
class Film:
    """Film of a record, seen from above, a panel for each robot.

    Both methods raise a ParameterError if a field is out of range, the record does not go with its robot, or a robot
    has no title, and an OutputError if PyAV was built without its H.264 encoder.
    """

    record: xr.Dataset  #: see :mod:`chilopod.show.scene.frames`
    _: KW_ONLY
    titles: Mapping[Any, str] | Sequence[str]  #: of the robots, by label or in their order
    heading: str  #: above all panels
    fps: int = 25  #: frames per second of the film
    speed: float = 1.0  #: seconds of the walk per second of the film
    size: tuple[int, int] = (960, 480)  #: width and height, even pixels
    follow: bool = False  #: True if every panel follows its robot; otherwise all show the same floor with all walks

    def mp4(self) -> bytes:
        """The film, H.264 in mp4: browsers and presentations play it before it is loaded whole."""
        times = self._times()
        with self._stage(times) as stage:
            return encoded(map(stage.drawn, range(len(times))), self.fps, self.size)

    def poster(self) -> bytes:
        """Frame of the film in its last third, when it shows the outcome of the walks, as PNG."""
        times, stream = self._times(), io.BytesIO()
        with self._stage(times) as stage:
            imsave(stream, stage.drawn(3 * (len(times) - 1) // 4), format="png")
        return stream.getvalue()

    @contextmanager
    def _stage(self, times: Array) -> Iterator[Stage]:
        with style.house_style():
            yield Stage(self, scene(self.record, self.titles, times))

    def _times(self) -> Array:
        """Times of the frames, s."""
        fps, speed = self.fps, self.speed
        if not 1 <= fps <= 120:
            raise ParameterError("must be a frame rate", field="fps", value=fps, allowed="1 to 120 per second")
        if not _SLOWEST <= speed <= FASTEST:
            raise ParameterError("must be a speed", field="speed", value=speed, allowed=f"{_SLOWEST:g} to {FASTEST:g}")
        if any(side % 2 or not _SMALLEST <= side <= LARGEST for side in self.size):
            allowed = f"two even numbers from {_SMALLEST} to {LARGEST}"
            raise ParameterError("must be the size of a film", field="size", value=self.size, allowed=allowed)
        if not has_encoder():
            raise OutputError(f"PyAV was built without the encoder {ENCODER}, which movies need")
        recorded = self.record["time"].values.astype(np.float64)
        # The last frame is the last sample, with what it came to; the tolerance is for round-off in the duration.
        count = math.ceil((recorded[-1] - recorded[0]) * fps / speed - 1e-6) + 1
        times: Array = np.minimum(recorded[0] + np.arange(count) * (speed / fps), recorded[-1])
        return times


class Stage:
    """Frames of the panels: moving parts are drawn anew over the fixed ones."""

    def __init__(self, film: Film, shown: Scene) -> None:
        self.shown, self.size, self.follow = shown, film.size, film.follow
        self.floor = close(shown.frames) if self.follow else shown.floor
        width, height = self.size
        self.font = max(12.0, min(height / 32.0, width / 48.0))
        self.figure = Figure(figsize=(width / PIXEL, height / PIXEL), dpi=PIXEL)
        self.canvas: Any = FigureCanvasAgg(self.figure)  # matplotlib does not say what its methods take and give
        top = height - 0.45 * self.font
        self.clock = self._text(width - GAP, top, "", ha="right", va="top", animated=True)
        self.pace = "" if film.speed == 1.0 else f"   ({film.speed:g}×)"
        self.clock.set_text(self._time(len(shown.frames.time) - 1))
        title = self._text(GAP, top, film.heading, va="top", fontsize=1.2 * self.font, weight="bold")
        self._fit(title, width - 3.0 * GAP - self._extent(self.clock))
        self._panels(GAP + self._legend(), top - 1.9 * self.font)
        self.known: tuple[object, ...] = ()
        self.background: Any = None

    def drawn(self, index: int) -> NDArray[np.uint8]:
        """The frame of a time."""
        now = self.shown.frames.time[index]
        known = tuple(panel.known(now) for panel in self.panels)
        if self.background is None or known != self.known:
            for panel in self.panels:
                panel.tell(now)
            self.canvas.draw()
            self.known, self.background = known, self.canvas.copy_from_bbox(self.figure.bbox)
        self.canvas.restore_region(self.background)
        renderer = self.canvas.get_renderer()
        self.clock.set_text(self._time(index))
        self.clock.draw(renderer)
        for panel in self.panels:
            for artist in panel.placed(index):
                artist.draw(renderer)
        return np.asarray(self.canvas.buffer_rgba())

    def _time(self, index: int) -> str:
        time = self.shown.frames.time
        return f"{time[index]:.1f} s of {time[-1]:.1f} s{self.pace}"

    def _text(self, x: float, y: float, text: str, **look: Any) -> Text:
        return self.figure.text(x / self.size[0], y / self.size[1], text, **{"fontsize": self.font, **look})

    def _extent(self, artist: Text | Legend) -> float:
        return float(artist.get_window_extent(self.canvas.get_renderer()).width)

    def _fit(self, text: Text, room: float) -> None:
        """Cut a text that is wider than its room."""
        whole = text.get_text()
        for kept in range(len(whole), 0, -1):
            if self._extent(text) <= room:
                return
            text.set_text(whole[: kept - 1].rstrip() + "…")

    def _legend(self) -> float:
        """Draw the key in as few lines as it takes; returns its height."""
        cross: dict[str, Any] = {"ls": "", "marker": "+", "ms": 0.8 * self.font, "mew": 2, "color": COLORS["target"]}
        handles: list[Patch | Line2D] = [
            Patch(fc=COLORS["edge"], ec=COLORS["edge"], label="module 1"),
            Patch(fc=COLORS["body"], ec=COLORS["edge"], label="other modules"),
            _dot(COLORS["ink"], COLORS["ink"], 0.6 * self.font, label="standing foot"),
            _dot("white", COLORS["air"], 0.6 * self.font, label="foot in the air"),
            _dot("white", COLORS["spring"], 0.6 * self.font, 2.5, label="spring (thin: soft)"),
            Line2D([], [], color=COLORS["path"], label="path of module 1"),
            *([Line2D([], [], **cross, label="target")] if any(self.shown.aims) else []),
        ]
        for rows in range(1, len(handles) + 1):
            spaces = {"borderaxespad": 0.4, "columnspacing": 1.4, "handlelength": 1.5, "handletextpad": 0.5}
            look = {"ncols": math.ceil(len(handles) / rows), "fontsize": max(12.0, 0.85 * self.font), **spaces}
            legend = self.figure.legend(handles=handles, loc="lower left", **look)
            if self._extent(legend) <= self.size[0] - GAP:
                break
            legend.remove()
        return float(legend.get_window_extent(self.canvas.get_renderer()).height)

    def _tall(self, lines: int) -> float:
        """Height of a caption."""
        return (0.35 + 1.35 * lines) * self.font

    def _place(self, caption: Sequence[Text], at: tuple[float, float], across: float, lines: int) -> None:
        """Put a caption over its panel: title and outcome in one line, or in two."""
        below = (at[0] + across, at[1]) if lines == 1 else (at[0], at[1] - 1.35 * self.font)
        caption[1].set_horizontalalignment("right" if lines == 1 else "left")
        for text, place in zip(caption, (at, below), strict=True):
            text.set_position((place[0] / self.size[0], place[1] / self.size[1]))
            self._fit(text, across)

    def _panels(self, bottom: float, top: float) -> None:
        """Lay the panels out, all of one size, in the middle of the room there is."""
        width, outcomes = self.size[0] - 2.0 * GAP, [_MARKS[each.kind][0] + each.text for each in self.shown.outcomes]
        captions = [
            [self._text(0.0, 0.0, each, weight="bold", va="top") for each in both]
            for both in zip(self.shown.titles, outcomes, strict=True)
        ]
        longest = max(sum(map(self._extent, both)) for both in captions) + self.font
        across, tall, columns, lines = self._layout(width, top - bottom, longest)
        caption, rows = self._tall(lines), math.ceil(len(self.shown.titles) / columns)
        left = GAP + 0.5 * (width - columns * across - (columns - 1) * APART)
        top -= max(0.0, 0.5 * (top - bottom + GAP - rows * (tall + caption + GAP)))
        self.panels = []
        for index, both in enumerate(captions):
            x = left + (index % columns) * (across + APART)
            y = top - (index // columns) * (tall + caption + GAP)
            self._place(both, (x, y), across, lines)
            self.panels.append(self._panel(index, (x, y - caption), (across, tall), both[1]))

    def _layout(self, width: float, height: float, longest: float) -> tuple[float, float, int, int]:
        """Width and height of a panel, columns, and lines of a caption: one if there is room for title and outcome."""
        count, (floor_width, floor_height) = len(self.shown.titles), self.floor.size.tolist()
        aspect = floor_height / floor_width
        for lines in (1, 2):
            sizes = []
            for columns in range(1, count + 1):
                rows = math.ceil(count / columns)
                wide = (width - APART * (columns - 1)) / columns
                sizes.append((min(wide, ((height - GAP * (rows - 1)) / rows - self._tall(lines)) / aspect), columns))
            across, columns = max(sizes)
            if longest <= across:
                break
        across = max(across, 40.0)
        return across, across * aspect, columns, lines

    def _panel(self, index: int, at: tuple[float, float], size: tuple[float, float], outcome: Text) -> FilmPanel:
        """Panel below a place; sizes in pixels."""
        box = (at[0], at[1] - size[1], *size)
        axes = self.figure.add_axes(tuple(np.array(box) / np.tile(self.size, 2)))
        zoom, near = size[0] / (self.floor.x1 - self.floor.x0), self.floor if self.follow else None
        return FilmPanel(self.shown, index, axes, zoom, self.font, outcome, near)


class FilmPanel:
    """One robot on its floor, or on the piece of floor ``near`` it that follows it; ``zoom`` in pixels per metre."""

    def __init__(
        self, shown: Scene, robot: int, axes: Axes, zoom: float, font: float, label: Text, near: Floor | None = None
    ) -> None:
        self.shown, self.robot, self.label, self.axes, self.follow = shown, robot, label, axes, near is not None
        self.outcome, self.outcome_text = shown.outcomes[robot], label.get_text()
        self.rings: list[tuple[Circle, Line2D]] = []
        self.floor, frames = near or shown.floor, shown.frames
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set(visible=True, color=COLORS["grid"])
        self.lines = LineCollection([], colors=COLORS["grid"], linewidths=1.0, zorder=0)
        self._look_at(self.floor)
        self._scale_bar(axes, zoom, font)
        for aim in shown.aims[robot]:
            ring = Circle(aim.place, shown.arrival_radius, ec=COLORS["target"], lw=1.5)
            axes.add_patch(ring)
            (cross,) = axes.plot(*aim.place, "+", color=COLORS["target"], ms=10.0, mew=2.0)
            self.rings.append((ring, cross))

        length = frames.robot.module_length
        thin = max(0.8, min(1.5, 0.02 * length * zoom))
        foot, self.ring = 2.0 * max(2.0, 0.055 * length * zoom), max(2.0, 0.06 * length * zoom)
        n = frames.robot.body.modules
        self.outline = _outline(length)
        offset, side = frames.robot.legs.forward_offset, 0.5 * SLIMNESS * length
        self.hips = np.array([[offset, side], [offset, -side]])
        self.modules = PolyCollection(
            [], facecolors=[COLORS["edge"], *[COLORS["body"]] * (n - 1)], edgecolors=COLORS["edge"], linewidths=thin
        )
        self.legs = LineCollection([], linewidths=thin)
        self.path = Line2D([], [], color=COLORS["path"], lw=2.0)
        self.joints = axes.scatter([], [], s=(2.0 * self.ring) ** 2, facecolors="white", zorder=4)
        self.spring = axes.text(0.985, 0.03, "", transform=axes.transAxes, ha="right", fontsize=max(12.0, 0.85 * font))
        self.swinging = _dot("white", COLORS["air"], foot, thin)
        self.standing = _dot(COLORS["ink"], COLORS["ink"], foot, thin)
        moving = (self.lines, self.legs, self.modules, self.path, self.swinging, self.standing)
        self.artists: tuple[Artist, ...] = (*moving[:4], self.joints, *moving[4:], self.spring)
        if self.follow:  # targets move over the picture, too
            self.artists = (self.lines, *chain.from_iterable(self.rings), *self.artists[1:])
        for artist in moving:
            axes.add_artist(artist)
        for each in self.artists:
            each.set_animated(True)
            each.set_clip_path(axes.patch)

    def known(self, now: float) -> tuple[object, ...]:
        """Key of the content that :meth:`tell` shows: the outcome, and of each target that has begun its own."""
        begun = self.shown.begun(self.robot, now)
        return (bool(now >= self.outcome.time - 1e-9), *(aim.is_reached(now) for aim in begun))

    def tell(self, now: float) -> None:
        """Show the outcome, or that there is none yet, and the targets so far."""
        known, *reached = self.known(now)
        self.label.set_text(self.outcome_text if known else "walking")
        self.label.set_color(_MARKS[self.outcome.kind][1] if known else "#555555")
        self.label.set_fontweight("bold" if known else "normal")
        for index, (ring, cross) in enumerate(self.rings):
            # Of those that have had their turn a faint ring stays.
            now_or_before, present = index < len(reached), index == len(reached) - 1
            ring.set_visible(now_or_before)
            cross.set_visible(present)
            arrived = now_or_before and reached[index]
            ring.set_facecolor((COLORS["target"], (0.35 if arrived else 0.1) if present else 0.0))
            ring.set_edgecolor((COLORS["target"], 1.0 if present else 0.4))
            ring.set_linestyle("-" if arrived else (0, (4, 3)))

    def placed(self, index: int) -> Sequence[Any]:
        """Moving objects, placed at a time."""
        frames, robot = self.shown.frames, self.robot
        spine, centres, stands = frames.spine[index, robot], frames.centres[index, robot], frames.stands[index, robot]
        if np.isnan(spine).any():
            return (self.lines,)
        if self.follow:
            around = slice(max(0, index - CALM), index + CALM + 1)
            middle = np.nanmean(frames.spine[around, robot], axis=(0, 1))
            self._look_at(Floor.of(middle, self.floor.size, self.floor.grid))
        headings, feet = frames.headings[index, robot], frames.feet[index, robot]
        self.modules.set_verts(list(from_modules(centres, headings, self.outline)))
        self.modules.set_alpha(1.0 if frames.walks[index, robot] or self.outcome.kind != "stopped" else 0.45)
        hips = from_modules(centres, headings, self.hips)
        self.legs.set_segments(list(np.stack([hips, feet], axis=-2).reshape(-1, 2, 2)))
        self.legs.set_color([COLORS["ink"] if each else COLORS["air"] for each in stands.ravel()])
        self.path.set_data(*frames.centres[: index + 1, robot, 0].T)
        widths, colors = style.springs(self.shown.shares[index, robot])
        self.joints.set_offsets(spine[1:-1])
        self.joints.set(linewidths=self.ring * widths, edgecolors=colors)
        if self.shown.steers(robot):
            self.spring.set_text(f"k₁ = {spring(units.from_si(float(self.shown.springs[index, robot, 0]), SPRING), 3)}")
        self.standing.set_data(*feet[stands].T)
        self.swinging.set_data(*feet[~stands].T)
        return self.artists

    def _look_at(self, floor: Floor) -> None:
        """Show a piece of the floor."""
        self.axes.set(xlim=(floor.x0, floor.x1), ylim=(floor.y0, floor.y1))
        x, y = (
            floor.grid * np.arange(math.ceil(low / floor.grid), high / floor.grid)
            for low, high in ((floor.x0, floor.x1), (floor.y0, floor.y1))
        )
        upright, level = ([(at, floor.y0), (at, floor.y1)] for at in x), ([(floor.x0, at), (floor.x1, at)] for at in y)
        self.lines.set_segments([*upright, *level])

    def _scale_bar(self, axes: Axes, zoom: float, font: float) -> None:
        grid, (wide, tall) = self.floor.grid, self.floor.size.tolist()
        bar = grid if wide > 1.6 * grid else 0.1 * grid
        # Of the panel, not of the floor, which may move.
        x, y, bar_end = 12.0 / zoom / wide, 0.9 * font / zoom / tall, (12.0 / zoom + bar) / wide
        look: dict[str, Any] = {"color": COLORS["ink"], "transform": axes.transAxes}
        axes.plot([x, bar_end], [y, y], lw=3.0, solid_capstyle="butt", **look)
        axes.plot([x, bar_end], [y, y], "|", ms=11.0, mew=1.5, **look)
        halo = [withStroke(linewidth=4.0, foreground="white")]
        look |= {"va": "center_baseline", "fontsize": max(12.0, 0.85 * font), "path_effects": halo}
        axes.text(bar_end + 6.0 / zoom / wide, y, f"{bar:g} m", **look)


def _dot(face: str, edge: str, size: float, line: float = 1.2, **more: Any) -> Line2D:
    return Line2D([], [], ls="", marker="o", ms=size, mfc=face, mec=edge, mew=line, **more)


def _outline(length: float) -> NDArray[np.float64]:
    """A rounded box about the origin that leaves room for the joints, (V, 2)."""
    width = SLIMNESS * length
    radius = 0.4 * width
    angles = np.linspace(0.0, 2.0 * np.pi, 20, endpoint=False) + np.pi / 20.0
    around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    corner = np.array([0.46 * length - radius, 0.5 * width - radius])
    return np.sign(around) * corner + radius * around
