"""Where the time of a walk is cut: at the switches of the contact pattern, at samples, and where a command comes.

A walk is carried from cut to cut, and the integrator takes its steps within. So that the same steps are taken however
the walk is asked to advance, it stops for good only at cuts that are there anyhow; from the last of them to where it
was asked to go it is carried on a copy, which becomes the walk only if a command comes there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.compiled import njit
from chilopod.gait import Schedule

Array = NDArray[np.float64]

_SAME_INSTANT = 1e-10  # s


class Timeline:
    """The cuts of one walk.

    Parameters
    ----------
    schedule
        Contact pattern of one period.
    rate
        Samples per second; 0 for none.

    Attributes
    ----------
    position
        Where it is, as plain numbers: of the last cut and of the last command (s), the widths of the contact intervals
        gone by since that command (s), the number of the present one, and of the next sample.
    """

    def __init__(self, schedule: Schedule, rate: float) -> None:
        self._times = schedule.times
        self._rate = rate
        self.position: Array = np.array([0.0, 0.0, 0.0, 0.0, 1.0])

    @property
    def cut(self) -> float:
        """The last one, s."""
        return float(self.position[0])

    @property
    def samples(self) -> int:
        """How many lie behind the last cut, with that at time 0."""
        return int(self.position[4])

    def whole_pieces(self, until: float) -> tuple[Array, Array, Array, NDArray[np.intp], NDArray[np.intp]]:
        """Go on to the last cut up to a time.

        Returns
        -------
        Of every piece between two cuts: when it begins (s), where in its contact interval that is (s), how long it
        lasts (s), which interval of the period that is, and which sample is taken at its end, or -1.
        """
        # More than there can be: the switches and samples in between.
        span = max(until - self.cut, 0.0)
        intervals = len(self._times) - 1
        most = int((span / self._times[-1] + 2.0) * intervals + span * self._rate) + 3
        pieces = np.empty((3, most))
        numbers = np.empty((2, most), dtype=np.intp)
        count = _whole_pieces(self._times, self._rate, until, self.position, pieces, numbers)
        begins, starts, widths = pieces[:, :count]
        return begins, starts, widths, numbers[0, :count], numbers[1, :count]

    def rest(self, until: float) -> tuple[Array, Array, Array, NDArray[np.intp], NDArray[np.intp]]:
        """The piece from the last cut to a time before the next; there is none if nothing is between."""
        pieces, numbers = np.empty((3, 1)), np.full((2, 1), -1, dtype=np.intp)
        count = _rest(self._times, self._rate, until, self.position, pieces, numbers)
        begins, starts, widths = pieces[:, :count]
        return begins, starts, widths, numbers[0, :count], numbers[1, :count]

    def cut_at(self, time: float) -> None:
        """Cut where a command comes."""
        _cut_at(self._rate, time, self.position)


@njit
def _interval(times: Any, number: int, anchor: float) -> tuple[float, float, float]:
    """Begin (not before the last command), end and switch of a contact interval, s."""
    intervals = times.size - 1
    cycle, index = number // intervals, number % intervals
    switch = times[-1] * cycle + times[index]
    end = times[-1] * cycle + times[index + 1] if index + 1 < intervals else times[-1] * (cycle + 1)
    return max(switch, anchor), end, switch


@njit
def _whole_pieces(times: Any, rate: float, until: float, position: Any, pieces: Any, numbers: Any) -> int:
    cut, anchor, elapsed = position[0], position[1], position[2]
    number, sample = int(position[3]), int(position[4])
    count = 0
    while True:
        begin, end, switch = _interval(times, number, anchor)
        if end <= begin:
            number += 1
            continue
        low = anchor + elapsed
        high = anchor + (elapsed + (end - begin))
        at = sample / rate if rate > 0.0 else np.inf
        if at <= high - _SAME_INSTANT:
            if at > until + _SAME_INSTANT:
                break
        elif high > until:
            break
        inside = at <= high - _SAME_INSTANT
        stop = at if inside else high
        if stop > cut:
            pieces[0, count] = cut
            pieces[1, count] = (begin - switch) + (cut - low)
            pieces[2, count] = stop - cut
            numbers[0, count] = number % (times.size - 1)
            numbers[1, count] = -1
            count += 1
            cut = stop
        # A sample that falls on a switch is taken there.
        while at < stop + _SAME_INSTANT:
            if count:
                numbers[1, count - 1] = sample
            sample += 1
            at = sample / rate
        if not inside:
            elapsed += end - begin
            number += 1
    position[0], position[1], position[2], position[3], position[4] = cut, anchor, elapsed, number, sample
    return count


@njit
def _rest(times: Any, rate: float, until: float, position: Any, pieces: Any, numbers: Any) -> int:
    cut, anchor, elapsed = position[0], position[1], position[2]
    number, sample = int(position[3]), int(position[4])
    begin, end, switch = _interval(times, number, anchor)
    while end <= begin:
        number += 1
        begin, end, switch = _interval(times, number, anchor)
    low = anchor + elapsed
    stop = anchor + (elapsed + (min(until, end) - begin))
    if not stop > cut:
        return 0
    pieces[0, 0] = cut
    pieces[1, 0] = (begin - switch) + (cut - low)
    pieces[2, 0] = stop - cut
    numbers[0, 0] = number % (times.size - 1)
    if rate > 0.0 and sample / rate < stop + _SAME_INSTANT:
        numbers[1, 0] = sample
    return 1


@njit
def _cut_at(rate: float, time: float, position: Any) -> None:
    if rate > 0.0:
        while position[4] / rate < time + _SAME_INSTANT:
            position[4] += 1.0
    position[0] = max(time, position[0])
    position[1], position[2] = position[0], 0.0
