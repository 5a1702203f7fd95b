"""Errors of the return maps of a followed orbit, from that at its first orbit."""

from __future__ import annotations

import numpy as np

from chilopod.flows import deadline
from chilopod.flows.carrying import numerical_balance
from chilopod.frozen import Array
from chilopod.stability.crossing_place import Sample
from chilopod.stability.returns import BESIDE, return_map, section_at
from chilopod.stability.search.samples import NEAR_FOLD, Samples

_SURE = 1e-4  # singular value of H - 1, in units, above which the orbit is as accurate as the flow
_FOLLOWED, _LEAST_ERROR = 10.0, 1e-15  # factor on the error of the first orbit for that of others, and least error


class Accuracy:
    """Relative errors of the derivatives of return maps.

    ``of_flow`` is the flow's, in units that balance the states: it may contract strongly within a return, and at
    followed orbits less than at the first one.
    """

    def __init__(self, samples: Samples) -> None:
        self._samples = samples
        self._bends: dict[float, float] = {}  # changes of derivatives beside samples, by value
        first, image = samples.first, samples.first.image
        if Sample(samples.low, first.state, image).off_plus_one <= NEAR_FOLD:  # the orbit is less accurate
            image = return_map(samples.family(samples.low), first.state, True, first.section)
        # An entry of round-off gives no information on the units.
        units = numerical_balance(np.abs(image.jacobian) + np.nan_to_num(image.error))
        largest = max(1.0, float(np.abs(image.jacobian * units / units[:, None]).max()))
        relative = float(np.max(image.error * units / units[:, None])) / largest
        self.of_flow = _FOLLOWED * max(_LEAST_ERROR, relative)

    def errors(self, found: list[Sample]) -> Array:
        """Errors at samples: that of the flow and its derivative, and that due to the orbit's error, the flow's times
        the inverse of H - 1."""
        deadline.check(deadline.MORE)  # the decompositions take long for many states
        of_flow, size = self.of_flow, self._samples.size
        units = size / size[:, None]
        result = np.full(len(found), of_flow)
        _, values, rows = np.linalg.svd(np.array([each.image.jacobian for each in found]) * units - np.eye(size.size))
        for i in np.flatnonzero(values[:, -1] <= _SURE):
            sample = found[i]
            if sample.value not in self._bends:
                system, duration = self._samples.family(sample.value), sample.image.duration
                section = section_at(system, sample.orbit, size, duration)
                beside = return_map(system, sample.orbit + BESIDE * size * rows[i, -1], False, section)
                change = (beside.jacobian - sample.image.jacobian) * units
                self._bends[sample.value] = float(np.linalg.norm(change)) / BESIDE
            # Where H - 1 vanishes along a direction, the rest is of third order, except in special cases.
            off = min(of_flow / max(float(values[i, -1]), of_flow), of_flow ** (1.0 / 3.0))
            result[i] = min(1.0, of_flow + self._bends[sample.value] * off)
        return result
