"""Positions as whole numbers of 16 bits, for pages that play them."""

from __future__ import annotations

from base64 import b64encode
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

LARGEST: Final = 32767
"""Largest whole number that stands for a position; the smallest is minus that."""

_NOWHERE: Final = -32768  # stands for NaN


def packed(values: NDArray[np.float64], origin: NDArray[np.float64], step: NDArray[np.float64] | float) -> NDArray[Any]:
    """Whole numbers of steps from an origin, clipped to their range."""
    with np.errstate(over="ignore"):
        steps = np.round((values - origin) / step).clip(-LARGEST, LARGEST)
    return np.where(np.isnan(steps), _NOWHERE, steps).astype("<i2")


def encoded(values: NDArray[Any]) -> str:
    """An array, which should be little-endian, in base64."""
    return b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
