"""Planar model for periodic walks along a parameter: many robots in a call, few tangents, means over a period."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import qr

from chilopod.errors import ParameterError
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.integrate import COMPLEX_STEP
from chilopod.planar.drift import Drift
from chilopod.planar.energy import foot_powers, foot_slip
from chilopod.planar.model import PlanarModel, carry, carry_tangents

NODES = 16
"""Gauss-Legendre nodes in every interval between two switches: after each one, motion settles within milliseconds."""

_AT_ONCE = 500  # walks whose motion is held in memory
_DERIVATIVE = 100.0  # tolerance of the derivative over that of the state
_CUTS = (1 / 6, 1 / 3, 1 / 2)  # of the interval, where tangents that have died out are dropped
_DEAD = 1e-12  # size of a tangent that no longer matters, relative to the largest


@dataclass(frozen=True, eq=False, repr=False)
class FollowedModel(PlanarModel):
    """The planar model for walks that are followed through a parameter.

    It gives the same answers as :class:`PlanarModel`, with a derivative good to some ten times ``tolerance``, and
    :meth:`flow_each` on top.
    """

    def flow(self, x: ArrayLike, t0: float, t1: float) -> tuple[Array, Array]:
        """:meth:`PlanarModel.flow`, dropping the tangents that die out on the way.

        Velocities settle to the pace of the feet within milliseconds, so after a part of the period the derivative has
        lost half its rank to round-off. There it is factored, derivative = left right, and only the columns of
        ``left`` that are still alive are carried on.
        """
        x = self._checked(x)
        if (x == self.orbit).all():
            return super().flow(x, t0, t1)
        switches = self._pieces(t0, t1)[1].cumsum() + t0
        cuts = [float(switches[np.abs(switches - (t0 + part * (t1 - t0))).argmin()]) for part in _CUTS]
        times = sorted({t0, *cuts, t1})
        tolerance = _DERIVATIVE * self.tolerance
        state, left, right = x.astype(np.complex128), np.eye(self.dimension), np.eye(self.dimension)
        for start, end in zip(times, times[1:], strict=False):
            batch = np.ascontiguousarray(state + 1j * COMPLEX_STEP * left.T)  # numba would compile everything once more
            carry_tangents(self, batch, start, end, tolerance)
            state, left = batch[0].real.astype(np.complex128), batch.imag.T / COMPLEX_STEP
            basis, upper, order = qr(left, mode="economic", pivoting=True)
            size = np.abs(np.diag(upper))
            alive = max(1, int((size > _DEAD * size[0]).sum()))
            if alive < left.shape[1]:
                unsorted = np.empty_like(upper)
                unsorted[:, order] = upper
                left, right = basis[:, :alive], unsorted[:alive] @ right
        return state.real.copy(), left @ right

    @staticmethod
    def flow_each(models: Sequence[PlanarModel], states: ArrayLike, t0: float, t1: float) -> Array:
        """Carry every state, shape (states, 2N+1) or with poses behind (states, 2N+4), from t0 to t1 (s) by the model
        of its own robot, on all cores; AnalysisError if a motion diverges."""
        batch = np.array(states, dtype=np.float64, order="C")
        _check_one_each(models, batch, "states")
        if not _alike(models):
            alone = zip(models, batch[:, None], strict=True)
            return np.concatenate([FollowedModel.flow_each([model], state, t0, t1) for model, state in alone])
        carry(models, batch, t0, t1, models[0].tolerance)
        return batch


@dataclass(frozen=True, eq=False)
class WalkMeans(ReadOnlyArrays):
    """Means of periodic walks over one period.

    Attributes
    ----------
    mean_angle
        Mean angle of every joint, rad, shape (walks, N-1).
    most_bent
        Largest angle of any joint within the period, rad, shape (walks,).
    leg_power
        Mean power that the legs deliver, W, shape (walks,).
    floor_power
        Mean power lost at the feet, W, never positive, shape (walks,).
    drifts
        Motion of each walk over the floor.
    """

    mean_angle: Array
    most_bent: Array
    leg_power: Array
    floor_power: Array
    drifts: tuple[Drift, ...]


def walk_means(models: Sequence[PlanarModel], orbits: ArrayLike) -> WalkMeans:
    """Means over one period of the walk of every robot that starts in its state at time 0, ``orbits`` of shape (walks,
    2N+1).

    All robots run through the period together, stopping at the nodes of Gauss-Legendre quadrature. Powers are those of
    :func:`chilopod.planar.powers`. AnalysisError if a motion diverges.
    """
    orbits = np.asarray(orbits, dtype=np.float64)
    _check_one_each(models, orbits, "orbits")
    if any(orbits.shape[1:] != (model.dimension,) for model in models):
        allowed = f"(walks, {models[0].dimension})"
        raise ParameterError(f"has the wrong shape {orbits.shape}", field="orbits", allowed=allowed)
    at_once = _AT_ONCE if _alike(models) else 1
    if len(orbits) > at_once:
        starts = range(0, len(orbits), at_once)
        parts = [walk_means(models[i : i + at_once], orbits[i : i + at_once]) for i in starts]
        names = ("mean_angle", "most_bent", "leg_power", "floor_power")
        means = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        return WalkMeans(**means, drifts=tuple(drift for part in parts for drift in part.drifts))
    first, schedule = models[0], models[0].schedule
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    fractions, widths = 0.5 * (1.0 + nodes), np.diff(schedule.times)
    states = np.zeros((len(orbits), first.dimension + 3))
    states[:, :-3] = orbits
    recorded = carry(models, states, 0.0, first.period, first.tolerance, fractions)
    share = 0.5 * weights * widths[:, None] / first.period
    angles = recorded[..., 3 : first.modules + 2]
    mean_angle, most_bent = np.einsum("sn,wsnj->wj", share, angles), np.abs(angles).max(axis=(1, 2, 3))
    legs, floor = _powers(models, np.moveaxis(recorded, 0, 2), widths[:, None] * fractions)
    drifts = tuple(Drift(ahead, left, turn, first.period) for ahead, left, turn in states[:, -3:].tolist())
    leg_power, floor_power = (np.einsum("sn,snw->w", share, power) for power in (legs, floor))
    return WalkMeans(mean_angle, most_bent, leg_power, floor_power, drifts)


def _check_one_each(models: Sequence[PlanarModel], states: Array, name: str) -> None:
    if states.ndim != 2 or not 0 < len(models) == len(states):
        raise ParameterError("must have one row for each model", field=name, value=states.shape, allowed="at least one")


def _alike(models: Sequence[PlanarModel]) -> bool:
    return all(models[0].can_flow_with(model) for model in models[1:])


def _powers(models: Sequence[PlanarModel], x: Array, since: Array) -> tuple[Array, Array]:
    """Powers of legs and floor, W, shape (pieces, nodes, walks), in states x, shape (pieces, nodes, walks, 2N+1),
    ``since`` (s), shape (pieces, nodes), the start of each piece."""
    schedule, speed = models[0].schedule, models[0].robot.gait.speed
    stroke = schedule.stroke[:, None] - speed * since[..., None, None]
    heading, slip = foot_slip(models, x, stroke[:, :, None])
    friction = np.array([model.robot.ground.friction for model in models])[:, None, None]
    return foot_powers(friction * schedule.contact[:, None, None], slip, heading, speed)
