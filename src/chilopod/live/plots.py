"""Joint angles over time, below the controls."""

from __future__ import annotations

from collections import deque

import numpy as np
import viser
from viser import uplot

from chilopod.frozen import Array
from chilopod.live.state import Seen
from chilopod.show.style import CURVES

_SPAN = 40.0  # s that are shown
_POINTS = 160


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
