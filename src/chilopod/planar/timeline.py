"""Cuts in the time of a walk: switches of the contact pattern, samples and commands.

A walk is integrated from cut to cut. It stops for good only at cuts that do not depend on the calls of ``advance``, so
that the steps are always the same. From the last cut to the time of the call a copy is integrated, which becomes the
walk only if a command is given there.

Times are not sums of others: a switch is a number of periods plus its phase, a sample is its number over the rate, a
command has the time given. Therefore the order of cuts does not depend on the calls either. A time that differs from a
cut by no more than rounding of whole multiples of the period (``BEGINNING``) is that cut.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from chilopod.compiled import njit
from chilopod.engine.arguments import BEGINNING
from chilopod.frozen import Array
from chilopod.gait import Schedule

_SAME_INSTANT = 1e-10  # s, within which a sample is taken at a switch


class Timeline:
    """Cuts of one walk, from the contact pattern of one period and the samples per second, 0 for none.

    Attribute ``position`` holds plain numbers: time of the last cut (s), number of the contact interval in which the
    cut lies or which it ends, counted from time 0, and number of the next sample.
    """

    def __init__(self, schedule: Schedule, rate: float) -> None:
        self._times = schedule.times
        self._rate = rate
        self._moment = max(BEGINNING * float(schedule.times[-1]), 10.0 * _SAME_INSTANT)
        self.position: Array = np.array([0.0, 0.0, 1.0])

    @property
    def cut(self) -> float:
        """Time of the last cut, s."""
        return float(self.position[0])

    @property
    def samples(self) -> int:
        """Number of samples up to the last cut, with that at time 0."""
        return int(self.position[2])

    def pieces(self, until: float, rest: bool = False) -> tuple[Any, ...]:
        """Go on to the last cut up to a time.

        Returns for every piece between two cuts its begin (s), the same relative to its contact interval (s), its
        duration (s), the number of the interval in the period, and the number of the sample at its end, or -1. With
        ``rest`` there follows the piece from the last cut to the time, without a sample, unless they are the same.
        """
        # Upper bound on the number of cuts: the switches and samples in between.
        span, intervals = max(until - self.cut, 0.0), len(self._times) - 1
        most = int((span / self._times[-1] + 2.0) * intervals + span * self._rate) + 4
        pieces, numbers = np.empty((3, most)), np.empty((2, most), dtype=np.intp)
        count = _whole_pieces(self._times, self._rate, until + self._moment, self.position, pieces, numbers)
        if rest and not self.is_at_cut(until):
            number, switch, _ = _interval_after(self._times, self.cut, int(self.position[1]))
            pieces[:, count] = self.cut, self.cut - switch, until - self.cut
            numbers[:, count] = number % intervals, -1
            count += 1
        return *pieces[:, :count], *numbers[:, :count]

    def is_at_cut(self, time: float) -> bool:
        """True if a time to which :meth:`pieces` went is that of the last cut."""
        return time <= self.cut + self._moment

    def sample_at(self, time: float) -> int:
        """Number of the sample that is the last cut up to a time from the present cut on; -1 if there is none."""
        sample = round(time * self._rate)
        at = sample / self._rate if self._rate > 0.0 else np.inf
        if abs(at - time) > self._moment:
            return -1
        _, _, end = _interval_after(self._times, at + _SAME_INSTANT, int(self.position[1]))
        return sample if end > time + self._moment else -1

    def cut_at(self, time: float) -> None:
        """Add a cut for a command, at a time to which :meth:`pieces` went, unless it is one already."""
        if not self.is_at_cut(time):
            self.position[0] = time


@njit
def _interval_after(times: Any, cut: float, number: int) -> tuple[int, float, float]:
    """First contact interval, from a number on, that ends after a cut: its number, begin and end (s)."""
    intervals = times.size - 1
    while True:
        cycle, index = number // intervals, number % intervals
        end = times[-1] * cycle + times[index + 1] if index + 1 < intervals else times[-1] * (cycle + 1)
        if end > cut:
            return number, times[-1] * cycle + times[index], end
        number += 1


@njit
def _whole_pieces(times: Any, rate: float, latest: float, position: Any, pieces: Any, numbers: Any) -> int:
    cut, number, sample, count = position[0], int(position[1]), int(position[2]), 0
    while True:
        number, switch, end = _interval_after(times, cut, number)
        at = sample / rate if rate > 0.0 else np.inf
        stop = at if at < end - _SAME_INSTANT else end
        if stop > latest:
            break
        pieces[0, count], pieces[1, count], pieces[2, count] = cut, cut - switch, stop - cut
        numbers[0, count], numbers[1, count] = number % (times.size - 1), -1
        cut = stop
        # A sample that falls on a switch is taken there.
        while at < cut + _SAME_INSTANT:
            numbers[1, count] = sample
            sample += 1
            at = sample / rate
        count += 1
    position[0], position[1], position[2] = cut, number, sample
    return count
