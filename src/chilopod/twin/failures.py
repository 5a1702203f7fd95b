"""Detection of failures: robots that no longer walk, their status and the step of the failure."""

from __future__ import annotations

from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from chilopod.engine import Status
from chilopod.engine.contract import Marks
from chilopod.frozen import Array

_FASTEST = 100.0  # m/s and rad/s: a robot that moves faster than that has blown up
_FARTHEST = 1e6  # m and rad, likewise
_UPRIGHT = 0.5  # cosine of the tilt of module 1 beyond which it has fallen over
_MOST_BENT = 0.5 * np.pi  # rad, of a yaw joint


def failures(
    positions: Array, rates: Array, before: tuple[Array, Array], yaw_positions: NDArray[np.intp], warned: Marks
) -> dict[int, tuple[int, Status]]:
    """Failures of the robots of a batch in some steps: for each robot the first step after its walk, and its status.

    Positions and rates are MuJoCo's ``qpos`` and ``qvel`` after every step, shapes (robots, steps, nq) and (robots,
    steps, nv), ``before`` the same before the first step, (robots, nq) and (robots, nv). ``yaw_positions`` are
    the indices of the yaw joints in ``qpos``, (N-1,). MuJoCo stops a robot with a warning, (robots,), and repeats its
    last state.
    """
    bends = positions[..., yaw_positions]
    with np.errstate(invalid="ignore", over="ignore"):
        # Cosine of the tilt, from the quaternion.
        upright = 1.0 - 2.0 * (positions[..., 4] ** 2 + positions[..., 5] ** 2)
        most = (np.abs(rates).max(), np.abs(positions).max(), np.abs(bends).max(), -upright.min())
        if not warned.any() and np.less(most, (_FASTEST, _FARTHEST, _MOST_BENT, -_UPRIGHT)).all():
            return {}  # the usual case, and fast
        quiet = (np.abs(rates).max(2) < _FASTEST) & (np.abs(positions).max(2) < _FARTHEST)
        straight, standing = np.abs(bends).max(2) <= _MOST_BENT, upright > _UPRIGHT
    found = {}
    signs = ((quiet, Status.DIVERGED), (straight, Status.OUT_OF_RANGE), (standing, Status.FALLEN))
    for row in range(len(positions)):
        bad = [(int(np.argmin(good[row])), status) for good, status in signs if not good[row].all()]
        if bad:
            found[row] = min(bad, key=itemgetter(0))
        elif warned[row]:
            found[row] = _stopped(positions[row], rates[row], (before[0][row], before[1][row])), Status.DIVERGED
    return found


def _stopped(positions: Array, rates: Array, before: tuple[Array, Array]) -> int:
    """First step from which on the state only repeats, up to the end."""
    states = np.vstack([np.hstack(before), np.hstack([positions, rates])])
    moved = (np.diff(states, axis=0) != 0.0).any(axis=1)
    return int(np.flatnonzero(moved)[-1]) + 1 if moved.any() else 0
