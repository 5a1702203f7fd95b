"""Curves beside the picture: joint angles and radius over time, and the spring against its pitchfork."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import viser
from viser import uplot

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.frozen import Array
from chilopod.live.state import Seen
from chilopod.live.theory import Theory
from chilopod.live.words import radius_of
from chilopod.show.style import BLUE, CURVES, GREY, VERMILLION

_SPAN = 40.0  # s that are shown
_POINTS = 160
_WIDEST, _TIGHTEST = 10.0, 0.1  # m, of what is drawn
_HEIGHT = 170  # px
_NOWHERE = 1e-9  # outside of what is drawn: uPlot takes NaN for a number
_BETWEEN = 4  # dots from one point of the branch to the next


class Plots:
    """Three plots of a walk of a robot with some number of yaw joints; nothing is created during the walk."""

    def __init__(self, gui: viser.GuiApi, joints: int) -> None:
        self._times: deque[float] = deque(maxlen=_POINTS)
        self._angles: deque[Array] = deque(maxlen=_POINTS)
        self._radii: deque[tuple[float, float]] = deque(maxlen=_POINTS)
        time, none = uplot.Scale(time=False), uplot.Legend(show=False)
        radii = uplot.Scale(distr=3, range=(_TIGHTEST, _WIDEST))
        angles = [_line(CURVES[joint % len(CURVES)]) for joint in range(joints)]
        look: dict[str, Any] = {"legend": none, "height": _HEIGHT, "padding": (8, 12, 0, 0)}
        self._angle = gui.add_uplot(
            (np.zeros(2), *[np.zeros(2)] * joints),
            (uplot.Series(), *angles),
            title="Joint angles over time (deg, s)",
            scales={"x": time},
            **look,
        )
        self._radius = gui.add_uplot(
            (np.zeros(2), *[np.ones(2)] * 2),
            (uplot.Series(), _line(BLUE, 2.0), _dots(VERMILLION, 3)),
            title="Radius; dots: where it settles (m, s)",
            scales={"x": time, "y": radii},
            **look,
        )
        self._branch = gui.add_uplot(
            (np.array([0.0, 1.0]), *[np.ones(2)] * 4),
            (uplot.Series(), _dots(BLUE, 3), _dots(GREY, 3), _line(GREY, 1.0), _dots(VERMILLION, 12)),
            title="Radius over first spring (m, N·mm/deg)",
            scales={"x": time, "y": radii},
            **look,
        )

    def forget(self) -> None:
        """Begin anew."""
        for each in (self._times, self._angles, self._radii):
            each.clear()

    def add(self, seen: Seen, theory: Theory) -> None:
        """Keep the present state of the walk."""
        if self._times and seen.time - self._times[-1] < _SPAN / _POINTS:
            return
        settled = theory.settled(float(seen.stiffness[0]))
        self._times.append(seen.time)
        self._angles.append(np.rad2deg(seen.mean_angles))
        self._radii.append((_shown(radius_of(seen)), _NOWHERE if settled is None else _shown(settled)))

    def show(self, seen: Seen, theory: Theory) -> None:
        """Draw the states that are kept."""
        if len(self._times) >= 2:
            times = np.array(self._times)
            self._angle.data = (times, *np.array(self._angles).T.copy())
            self._radius.data = (times, *np.array(self._radii).T.copy())
        self._branch.data = _branch(theory, float(seen.stiffness[0]), _shown(radius_of(seen)))


def _branch(theory: Theory, spring: float, radius: float) -> tuple[Array, ...]:
    """Springs in rising order, with each series: stable and unstable walks, the pitchfork, the present walk."""
    along = np.linspace(0.0, len(theory.springs) - 1.0, _BETWEEN * len(theory.springs))
    points = np.arange(len(theory.springs))
    springs, radii, stable = np.empty(0), np.empty(0), np.empty(0, dtype=np.bool_)
    if len(points):
        springs = np.interp(along, points, theory.springs)
        curvature = np.interp(along, points, 1.0 / theory.radii)
        radii = 1.0 / np.clip(curvature, 1.0 / _WIDEST, 1.0 / _TIGHTEST)
        stable = theory.stable[np.rint(along).astype(np.intp)]
    fork = np.empty(0) if theory.pitchfork is None else theory.pitchfork * np.array([1.0 - 1e-6, 1.0, 1.0 + 1e-6])
    count = len(springs)
    springs = np.concatenate([springs, fork, [spring]])
    series = np.full((4, len(springs)), _NOWHERE)
    series[0, :count][stable] = radii[stable]
    series[1, :count][~stable] = radii[~stable]
    if len(fork):
        series[2, count + 1] = 1.0 / _NOWHERE
    series[3, -1] = radius
    order = np.argsort(springs, kind="stable")
    in_unit = units.from_si(1.0, PAPER_UNIT) * springs[order]
    return tuple(np.ascontiguousarray(each) for each in (in_unit, *series[:, order]))


def _line(color: str, width: float = 1.5) -> uplot.Series:
    return uplot.Series(stroke=color, width=width, points={"show": False})


def _dots(color: str, size: int) -> uplot.Series:
    return uplot.Series(stroke="transparent", width=0, points={"show": True, "size": size, "fill": color, "width": 0})


def _shown(radius: Any) -> Any:
    return np.clip(radius, _TIGHTEST, _WIDEST)
