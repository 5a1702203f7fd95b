"""Curves beside the picture: joint angles and radius over time, and the spring against its pitchfork."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray
from viser import uplot

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.live.session import Seen
from chilopod.live.theory import Theory
from chilopod.live.words import radius_of
from chilopod.report.kit.style import BLUE, CURVES, GREY, VERMILLION

Array = NDArray[np.float64]

_SPAN = 40.0  # s that are shown
_POINTS = 160
_WIDEST, _TIGHTEST = 10.0, 0.1  # m, of what is drawn
_HEIGHT = 165  # px
_NONE = np.full(2, np.nan)


class Plots:
    """Three plots of a walk; nothing is created as it goes on.

    Parameters
    ----------
    gui
        Where they are put.
    joints
        How many yaw joints there are.
    """

    def __init__(self, gui: viser.GuiApi, joints: int) -> None:
        self._times: deque[float] = deque(maxlen=_POINTS)
        self._angles: deque[Array] = deque(maxlen=_POINTS)
        self._radii: deque[tuple[float, float]] = deque(maxlen=_POINTS)
        time, short = uplot.Scale(time=False), uplot.Legend(show=joints <= 6)
        angle_series = [_line(f"θ{joint + 1}", CURVES[joint % len(CURVES)]) for joint in range(joints)]
        self._angle = gui.add_uplot(
            (np.zeros(2), *[np.zeros(2)] * joints),
            (uplot.Series(label="s"), *angle_series),
            title="Joint angles, mean of a gait cycle (deg) over time (s)",
            scales={"x": time},
            legend=short,
            height=_HEIGHT,
        )
        self._radius = gui.add_uplot(
            (np.zeros(2), np.ones(2), np.ones(2)),
            (uplot.Series(label="s"), _line("walk", BLUE, 2.0), _line("settled", VERMILLION, 1.5, dash=[6, 4])),
            title="Radius (m) over time (s)",
            scales={"x": time, "y": uplot.Scale(distr=3, range=(_TIGHTEST, _WIDEST))},
            height=_HEIGHT,
        )
        self._branch = gui.add_uplot(
            (np.array([0.0, 1.0]), *[_NONE] * 4),
            (
                uplot.Series(label="N·mm/deg"),
                _line("stable", BLUE, 2.0),
                _line("unstable", BLUE, 1.5, dash=[4, 4]),
                _line("pitchfork", GREY, 1.0, dash=[2, 3]),
                uplot.Series(
                    label="now", stroke=VERMILLION, width=0, points=uplot.Series_Points(show=True, size=11, fill=VERMILLION)
                ),
            ),
            title="Radius (m) over the first spring (N·mm/deg)",
            scales={"x": time, "y": uplot.Scale(distr=3, range=(_TIGHTEST, _WIDEST))},
            height=_HEIGHT,
        )

    def forget(self) -> None:
        """Begin anew."""
        for each in (self._times, self._angles, self._radii):
            each.clear()

    def add(self, seen: Seen, theory: Theory) -> None:
        """Remember what is seen now."""
        if self._times and seen.time - self._times[-1] < _SPAN / _POINTS:
            return
        settled = theory.settled(float(seen.stiffness[0]))
        self._times.append(seen.time)
        self._angles.append(np.rad2deg(seen.mean_angles))
        self._radii.append((_shown(radius_of(seen)), np.nan if settled is None else _shown(settled)))

    def show(self, seen: Seen, theory: Theory) -> None:
        """Draw what is remembered."""
        if len(self._times) >= 2:
            times = np.array(self._times)
            self._angle.data = (times, *np.array(self._angles).T.copy())
            self._radius.data = (times, *np.array(self._radii).T.copy())
        self._branch.data = _branch(theory, float(seen.stiffness[0]), _shown(radius_of(seen)))


def _branch(theory: Theory, spring: float, radius: float) -> tuple[Array, ...]:
    """Springs in rising order, and for each of them what there is of every curve."""
    count = len(theory.springs)
    radii = np.clip(theory.radii, _TIGHTEST, _WIDEST)
    fork = [] if theory.pitchfork is None else [theory.pitchfork]
    springs = np.concatenate([theory.springs, np.repeat(fork, 2), [spring]])
    curves = np.full((4, len(springs)), np.nan)
    curves[0, :count] = np.where(theory.stable, radii, np.nan)
    curves[1, :count] = np.where(theory.stable, np.nan, radii)
    curves[2, count:-1] = (_TIGHTEST, _WIDEST)[: 2 * len(fork)]
    curves[3, -1] = radius
    order = np.argsort(springs, kind="stable")
    return tuple(np.ascontiguousarray(each) for each in (units.from_si(1.0, PAPER_UNIT) * springs[order], *curves[:, order]))


def _line(label: str, color: str, width: float = 1.5, **look: Any) -> uplot.Series:
    return uplot.Series(label=label, stroke=color, width=width, spanGaps=True, points={"show": False}, **look)


def _shown(radius: float) -> float:
    return float(np.clip(radius, _TIGHTEST, _WIDEST))
