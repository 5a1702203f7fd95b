"""Plots beside the picture: the signed pitchfork with the walk as a moving point, and joint angles over time; and a
picture from above for browsers without WebGL."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from textwrap import wrap
from typing import Final

import numpy as np
import viser
from viser import uplot

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.frozen import Array
from chilopod.live.body import Placed
from chilopod.live.state import Seen
from chilopod.live.theory import Theory
from chilopod.show.figures.branch import stretches
from chilopod.show.style import CURVES, SCENE

_WIDTH, _HEIGHT = 320.0, 200.0  # px
_LEFT, _RIGHT, _TOP, _BOTTOM = 42.0, 312.0, 8.0, 166.0  # px, of the axes
_LETTERS, _BESIDE = 42, 28  # of a line, and of one beside branches
_TRAIL: Final = 60  # earlier points of the walk
_LEAST, _MOST = 60.0, 240.0  # deg of bend, between which the axis ends
_SPAN = 40.0  # s of joint angles that are shown
_POINTS = 160
_ABOVE = 800, 560  # px, of the picture from above
_LINE = 18  # px of a line of its text
STABLE, UNSTABLE = 'stroke-width="2.5"', 'stroke-width="1.5" stroke-dasharray="5 4"'


class Pitchfork:
    """Picture of a robot's branches whose axis ends at some spring (N*m/rad)."""

    def __init__(self, gui: viser.GuiApi, stiffest: float) -> None:
        self._stiffest, self._html = stiffest, gui.add_html("")
        self._trail: deque[tuple[float, float]] = deque(maxlen=_TRAIL)

    def forget(self) -> None:
        """Begin anew."""
        self._trail.clear()

    def show(self, seen: Seen, theory: Theory) -> None:
        """Draw branches, and the walk now and lately."""
        # Where the body bends to one side, this is its bend, left positive.
        self._trail.append((float(seen.stiffness[0]), -float(np.rad2deg(seen.mean_angles.sum()))))
        self._html.content = drawn(theory, self._stiffest, list(self._trail))


class Plots:
    """Plot of the mean angles of some number of yaw joints; nothing is created during the walk."""

    def __init__(self, gui: viser.GuiApi, joints: int) -> None:
        self._kept: deque[tuple[float, Array]] = deque(maxlen=_POINTS)  # times, and angles in deg
        colors = [CURVES[joint % len(CURVES)] for joint in range(joints)]
        self._angle = gui.add_uplot(
            (np.zeros(2), *[np.zeros(2)] * joints),
            (uplot.Series(), *(uplot.Series(stroke=color, width=1.5, points={"show": False}) for color in colors)),
            title="Joint angles over time (deg, s)",
            scales={"x": uplot.Scale(time=False)},
            legend=uplot.Legend(show=False),
            height=150,
            padding=(8, 12, 0, 0),
        )

    def forget(self) -> None:
        """Begin anew."""
        self._kept.clear()

    def add(self, seen: Seen) -> None:
        """Keep the present state of the walk."""
        if not self._kept or seen.time - self._kept[-1][0] >= _SPAN / _POINTS:
            self._kept.append((seen.time, np.rad2deg(seen.mean_angles)))

    def show(self) -> None:
        """Draw the states that are kept."""
        if len(self._kept) >= 2:
            times, angles = zip(*self._kept, strict=True)
            self._angle.data = (np.array(times), *np.array(angles).T.copy())


def drawn(theory: Theory, stiffest: float, trail: list[tuple[float, float]]) -> str:
    """SVG of branches with the walk at the last of some springs (N*m/rad) and bends (deg)."""
    bends = _bends(theory)
    known = [*(bends[theory.stable] if len(bends) else ()), *(abs(bend) for _, bend in trail)]
    most = float(np.clip(1.2 * max(known, default=0.0), _LEAST, _MOST))
    place = _Place(stiffest, most)
    parts = [*_axes(place), *_branches(theory, bends, place)]
    points = " ".join("{:.1f},{:.1f}".format(*place(*each)) for each in trail)
    parts.append(f'<polyline points="{points}" fill="none" stroke="{SCENE["path"]}" opacity="0.5"/>')
    if trail and np.isfinite(trail[-1]).all():
        x, y = place(*trail[-1])
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6" fill="{SCENE["path"]}" stroke="white"/>')
    return (
        f'<svg class="chilopod-fork" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" '
        f'aria-label="Bend over the first spring: branches and the present walk">{"".join(parts)}</svg>'
    )


@dataclass(frozen=True)
class _Place:
    """Pixels of springs (N*m/rad) and bends (deg)."""

    stiffest: float
    most: float

    def __call__(self, spring: float, bend: float) -> tuple[float, float]:
        x = _LEFT + (_RIGHT - _LEFT) * min(spring / self.stiffest, 1.0)
        return x, 0.5 * (_TOP + _BOTTOM) - 0.5 * (_BOTTOM - _TOP) * float(np.clip(bend / self.most, -1.0, 1.0))


def _bends(theory: Theory) -> Array:
    """Bends of the curved walks of a branch, deg."""
    if theory.robot is None or not len(theory.radii):
        return np.empty(0)
    return np.rad2deg((theory.robot.body.modules - 1) * theory.robot.module_length / theory.radii)


def _branches(theory: Theory, bends: Array, place: _Place) -> list[str]:
    parts, before = [], None
    for each in theory.straight:
        (x, y), end = place(each.low, 0.0), place(each.high, 0.0)
        if each.stable is not None and end[0] > x:
            parts.append(_line([(x, y), end], STABLE if each.stable else UNSTABLE))
        if each.begins and each.stable is not before and each.low < place.stiffest:
            way, right = f"{each.begins} {units.from_si(each.low, PAPER_UNIT):.3g}", x < 0.7 * _RIGHT
            parts.append(_text(x + 6.0 if right else x - 6.0, y - 7.0, way, "start" if right else "end"))
        before = each.stable
    if theory.pitchfork is None:
        rows, x, y, anchor = wrap(theory.remark, _LETTERS), 0.5 * (_LEFT + _RIGHT), _TOP + 26.0, "middle"
    else:  # branches are on the left, and the words beside them on the right
        rows, x, anchor = wrap(theory.remark, _BESIDE), _RIGHT, "end"
        y = _BOTTOM - 7.0 - 14.0 * len(rows)
    parts += [_text(x, y + 14.0 * row, escape(line), anchor) for row, line in enumerate(rows)]
    for side in (1.0, -1.0):
        points = [place(*each) for each in zip(theory.springs, side * bends, strict=True)]
        for first, last, stable in stretches(theory.stable.tolist()):
            parts.append(_line(points[first : last + 1], STABLE if stable else UNSTABLE))
    return parts


def _axes(place: _Place) -> list[str]:
    parts, tick = [], 90 if place.most >= 90.0 else 45
    for bend in range(-2 * tick, 2 * tick + 1, tick):
        if abs(bend) <= place.most:
            y = place(0.0, bend)[1]
            parts += [_grid(_LEFT, y, _RIGHT, y), _text(_LEFT - 4.0, y + 4.0, f"{bend}°".replace("-", "−"), "end")]
    widest = units.from_si(place.stiffest, PAPER_UNIT)
    step = 10.0 ** np.floor(np.log10(widest))
    for spring in np.arange(0.0, widest + 1e-9, step if widest > 3.0 * step else 0.5 * step):
        x = _LEFT + (_RIGHT - _LEFT) * spring / widest
        parts += [_grid(x, _TOP, x, _BOTTOM), _text(x, _BOTTOM + 14.0, f"{spring:g}", "middle")]
    middle, below = 0.5 * (_LEFT + _RIGHT), _BOTTOM + 29.0
    parts += [
        _text(middle, below, "first spring (N·mm/deg); dashed: unstable", "middle"),
        _text(_RIGHT, _TOP + 11.0, "bent to the left", "end"),
        _text(_RIGHT, _BOTTOM - 5.0, "bent to the right", "end"),
    ]
    return parts


def _line(points: list[tuple[float, float]], look: str) -> str:
    along = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{along}" fill="none" stroke="{SCENE["edge"]}" {look}/>'


def _grid(x0: float, y0: float, x1: float, y1: float) -> str:
    return f'<path d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}" stroke="currentColor" opacity="0.15"/>'


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>'


def from_above(placed: Mapping[str, Placed], length: float, words: str) -> bytes:
    """SVG of a robot's parts with a text below; length of the robot in m."""
    zoom, middle = 0.8 * _ABOVE[0] / (1.6 * length), placed["box"].centres[:, :2].mean(axis=0)
    parts = []
    for kind, color in (("box", SCENE["body"]), ("ball", SCENE["ink"])):
        here = placed[kind]
        each = zip(here.centres, here.turns, here.scales, strict=True)
        for index, ((x, y, _), (w, _, _, z), (along, across, _)) in enumerate(each):
            place = f"{_ABOVE[0] / 2 + zoom * (x - middle[0]):.1f} {0.4 * _ABOVE[1] - zoom * (y - middle[1]):.1f}"
            turn, a, b = -np.rad2deg(2.0 * np.arctan2(z, w)), zoom * along, zoom * across
            fill = SCENE["edge"] if kind == "box" and index == 0 else color
            shape = f'x="{-a / 2:.1f}" y="{-b / 2:.1f}" width="{a:.1f}" height="{b:.1f}" rx="{b / 4:.1f}"'
            parts.append(f'<rect {shape} fill="{fill}" transform="translate({place}) rotate({turn:.1f})"/>')
    lines = [line for paragraph in words.split("\n") for line in wrap(paragraph, 96)]
    for number, line in enumerate(lines):
        y = _ABOVE[1] - _LINE * (len(lines) - number)
        parts.append(f'<text x="16" y="{y}" font-family="sans-serif" font-size="15">{escape(line)}</text>')
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_ABOVE[0]} {_ABOVE[1]}">'
    return f'{head}<rect width="100%" height="100%" fill="white"/>{"".join(parts)}</svg>'.encode()
