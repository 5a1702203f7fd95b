"""Where the time of a walk is cut: at the switches of the contact pattern, at samples, and where a command comes.

A walk is carried from cut to cut, and the integrator takes its steps within. So that the same steps are taken however
the walk is asked to advance, it stops for good only at cuts that are there anyhow; from the last of them to where it
was asked to go it is carried on a copy, which becomes the walk only if a command comes there.

No time is a sum of others: a switch is so many periods and its place in the period, a sample its number over the rate,
a command comes at the time that was given. So a cut lies before another, or not, whoever asks. Who asks for a time that
lies beside a cut by no more than rounding of whole multiples of the period (``BEGINNING``) is at that cut.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.compiled import njit
from chilopod.engine.arguments import BEGINNING
from chilopod.gait import Schedule

Array = NDArray[np.float64]

_SAME_INSTANT = 1e-10  # s, within which a sample is taken at a switch


class Timeline:
    """The cuts of one walk, by the contact pattern of one period and samples per second, 0 for none.

    Attribute ``position`` is the place in time, as plain numbers: time of the last cut (s), number of the contact
    interval it lies in, counted from time 0, or ends, and number of the next sample.
    """

    def __init__(self, schedule: Schedule, rate: float) -> None:
        self._times = schedule.times
        self._rate = rate
        self._moment = max(BEGINNING * float(schedule.times[-1]), 10.0 * _SAME_INSTANT)
        self.position: Array = np.array([0.0, 0.0, 1.0])

    @property
    def cut(self) -> float:
        """The last one, s."""
        return float(self.position[0])

    @property
    def samples(self) -> int:
        """How many lie behind the last cut, with that at time 0."""
        return int(self.position[2])

    def whole_pieces(self, until: float) -> tuple[Array, Array, Array, NDArray[np.intp], NDArray[np.intp]]:
        """Go on to the last cut up to a time.

        Returns, of every piece between two cuts, when it begins (s), where in its contact interval that is (s), how
        long it lasts (s), which interval of the period that is, and which sample is taken at its end, or -1.
        """
        # More than there can be: the switches and samples in between.
        span = max(until - self.cut, 0.0)
        intervals = len(self._times) - 1
        most = int((span / self._times[-1] + 2.0) * intervals + span * self._rate) + 3
        pieces = np.empty((3, most))
        numbers = np.empty((2, most), dtype=np.intp)
        count = _whole_pieces(self._times, self._rate, until + self._moment, self.position, pieces, numbers)
        begins, starts, widths = pieces[:, :count]
        return begins, starts, widths, numbers[0, :count], numbers[1, :count]

    def rest(self, until: float) -> tuple[Array, Array, Array, NDArray[np.intp], NDArray[np.intp]]:
        """The piece from the last cut to a later time, to which :meth:`whole_pieces` went; nothing is sampled there."""
        number, switch, _ = _interval_after(self._times, self.cut, int(self.position[1]))
        cut = self.position[:1].copy()
        which = np.array([number % (len(self._times) - 1)])
        return cut, cut - switch, until - cut, which, np.array([-1])

    def is_at_cut(self, time: float) -> bool:
        """True if a time to which :meth:`whole_pieces` went is that of the last cut."""
        return time <= self.cut + self._moment

    def cut_at(self, time: float) -> None:
        """Cut where a command comes, at a time to which :meth:`whole_pieces` went, unless there is a cut."""
        if not self.is_at_cut(time):
            self.position[0] = time


@njit
def _interval_after(times: Any, cut: float, number: int) -> tuple[int, float, float]:
    """The contact interval, from one of that number on, that ends after a cut: its number, begin and end (s)."""
    intervals = times.size - 1
    while True:
        cycle, index = number // intervals, number % intervals
        end = times[-1] * cycle + times[index + 1] if index + 1 < intervals else times[-1] * (cycle + 1)
        if end > cut:
            return number, times[-1] * cycle + times[index], end
        number += 1


@njit
def _whole_pieces(times: Any, rate: float, latest: float, position: Any, pieces: Any, numbers: Any) -> int:
    cut, number, sample = position[0], int(position[1]), int(position[2])
    count = 0
    while True:
        number, switch, end = _interval_after(times, cut, number)
        at = sample / rate if rate > 0.0 else np.inf
        stop = at if at < end - _SAME_INSTANT else end
        if stop > latest:
            break
        pieces[0, count] = cut
        pieces[1, count] = cut - switch
        pieces[2, count] = stop - cut
        numbers[0, count] = number % (times.size - 1)
        numbers[1, count] = -1
        cut = stop
        # A sample that falls on a switch is taken there.
        while at < cut + _SAME_INSTANT:
            numbers[1, count] = sample
            sample += 1
            at = sample / rate
        count += 1
    position[0], position[1], position[2] = cut, number, sample
    return count
