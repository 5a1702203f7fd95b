"""Curves beside the picture: joint angles and radius over time."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import viser
from viser import uplot

from chilopod.frozen import Array
from chilopod.live.state import Seen
from chilopod.live.theory import Theory
from chilopod.live.words import radius_of
from chilopod.show.style import CURVES, GREY, SCENE

_SPAN = 40.0  # s that are shown
_POINTS = 160
_WIDEST, _TIGHTEST = 10.0, 0.1  # m, of what is drawn
_HEIGHT = 150  # px
_NOWHERE = 1e-9  # outside of what is drawn: uPlot takes NaN for a number


class Plots:
    """Two plots of a walk of a robot with some number of yaw joints; nothing is created during the walk."""

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
            (uplot.Series(), _line(SCENE["path"], 2.0), _dots(GREY, 3)),
            title="Radius; dots: where it settles (m, s)",
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

    def show(self) -> None:
        """Draw the states that are kept."""
        if len(self._times) >= 2:
            times = np.array(self._times)
            self._angle.data = (times, *np.array(self._angles).T.copy())
            self._radius.data = (times, *np.array(self._radii).T.copy())


def _line(color: str, width: float = 1.5) -> uplot.Series:
    return uplot.Series(stroke=color, width=width, points={"show": False})


def _dots(color: str, size: int) -> uplot.Series:
    return uplot.Series(stroke="transparent", width=0, points={"show": True, "size": size, "fill": color, "width": 0})


def _shown(radius: Any) -> Any:
    return np.clip(radius, _TIGHTEST, _WIDEST)
