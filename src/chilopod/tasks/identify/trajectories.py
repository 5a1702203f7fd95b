"""Identification of constants of the planar model from recorded walks, by nonlinear least squares.

Unknown are the free constants and, for each walk, the phase of the gait and the joint angles when the recording begins.
Each walk begins at rest in its joints there, as one does that is released. The true rates there are forgotten within a
part of a cycle, so samples count from then on. Derivatives are differences of walks that run together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from scipy.optimize import least_squares
from scipy.special import stdtrit

from chilopod.frozen import Array
from chilopod.notebook import axes_for
from chilopod.planar import PlanarModel, initial_states
from chilopod.planar.model import states_at
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.tasks.identify.constants import CONFIDENCE, Estimates, FreeConstants, Identified
from chilopod.tasks.identify.data import RecordedWalks
from chilopod.tasks.identify.recordings import Recording, read_recordings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STEP, _TOLERANCE = 1e-5, 1e-8  # of differences, in units of ranges, cycles and rad, and of walks
_FAR = np.pi  # angles after a walk has failed, rad
_PHASES, _CYCLES = 6, 10  # number of phases to start from, each tried on so many cycles
_ROUGH, _FINE = (1e-3, 12), (1e-9, 40)  # change of the sum of squares, relative, that ends a fit, and most steps
_RESOLVED = 1e-7  # rad, least error of angles, of a recording or computed
_OPEN = 3.0  # standard deviation of a constant without data, in ranges
_PRIOR = 1e-3  # weight of constants as given, in rad for a range
_ALIKE = 2.0  # factor of variances that is said
_NEAR = 0.1  # distance of a constant from its best value that leaves its interval as it is, standard deviations


@dataclass(frozen=True)
class RecordedIdentification(Identified):
    """Result of an identification from recorded walks: the constants, with intervals of linear residuals; measured and
    fitted joint angles, rad, these NaN before they count; the phase of the gait at the first sample of each walk,
    cycles; the scatter of the residuals, rad, and the factor by which variances grow where neighbouring residuals are
    alike; and whether the search converged."""

    estimates: Estimates
    walks: xr.Dataset
    phases: tuple[float, ...]
    scatter: float
    variance_factor: float
    converged: bool

    @property
    def title(self) -> str:
        """Robot, and the scatter of the residuals."""
        count, scatter = int((self.walks.fitted - self.walks.measured).count()), np.rad2deg(self.scatter)
        return f"{self.estimates.given.name}: residuals of {count} joint angles scatter by {scatter:.3g} deg"

    def as_json(self) -> dict[str, Any]:
        """Constants with intervals, correlations and combinations, phases, scatter, and the factor of variances."""
        rest = {"phases": list(self.phases), "variance_factor": self.variance_factor, "converged": self.converged}
        return {**super().as_json(), "scatter_rad": self.scatter, **rest}

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw joint angles of the first walk over time, dots as recorded and lines as computed."""
        axes, first = axes_for(axes), self.walks.isel(sample=self.walks.walk.values == 0)
        for joint, angles in enumerate(np.rad2deg([first.fitted, first.measured]).T):
            axes.plot(first.time, angles[:, 0], color=f"C{joint}", label=f"joint {joint + 1}")
            axes.plot(first.time, angles[:, 1], ".", markersize=2, color=f"C{joint}")
        axes.set(xlabel="time (s)", ylabel="joint angle (deg)")
        axes.legend()
        return axes

    def _remarks(self) -> list[str]:
        said = [f"the search ended after {_FINE[1]} steps, before it converged"] * (not self.converged)
        if self.variance_factor > _ALIKE and self.scatter > _RESOLVED:  # else they are rounding
            wide = f"intervals are {np.sqrt(self.variance_factor):.1f} times as wide as those of independent ones"
            said.append(f"neighbouring residuals are alike: the model or the recording is off; {wide}")
            if (largest := float(np.rad2deg(np.abs(self.walks.measured).max()))) <= 0.5 * np.pi:  # angles in rad too
                said.append(f"no joint angle exceeds {largest:.2g} deg: numbers in rad must have the unit rad")
        return said


def identify_recorded(
    robot: Robot, data: RecordedWalks, folder: str | Path, progress: Progress = silent
) -> RecordedIdentification:
    """Fit the free constants of a robot to recorded walks from files in a folder, with intervals of linear residuals.
    Directions that the data leave open end near the robot's constants. Errors are those of :func:`read_recordings`."""
    walks = _Walks(robot, data.free, read_recordings(robot, data, Path(folder)))
    unknown, count = _fit(walks, progress), len(data.free.each)
    measured = [each.angles for each in walks.recordings]
    fitted = [each[:, 0] for each in walks.computed(unknown[None])]
    apart = [one - other for one, other in zip(fitted, measured, strict=True)]
    off, factor = np.concatenate([each[np.isfinite(each)] for each in apart]), max(map(_alike, apart))
    scatter = float(np.linalg.norm(off) / np.sqrt(off.size - unknown.size))
    error = max(scatter, _RESOLVED)
    wide = float(stdtrit(max(off.size / factor - unknown.size, 1.0), 0.5 + 0.5 * CONFIDENCE))
    values, slopes = data.free.values_at(unknown[:count]), data.free.slopes(unknown[:count])
    spread = wide**2 * factor * error**2 * slopes @ walks.covariance(unknown, error) @ slopes.T
    ends = data.free.ends(unknown[:count], np.sqrt(np.diag(spread)) / np.diag(slopes))
    times = np.concatenate([each.times for each in walks.recordings])
    number = np.repeat(range(len(measured)), [len(each) for each in measured])
    record = xr.Dataset(coords={"time": ("sample", times, {"units": "s"}), "walk": ("sample", number)})
    for name, angles in (("measured", measured), ("fitted", fitted)):
        record[name] = ("sample", "joint"), np.vstack(angles), {"units": "rad"}
    estimates = Estimates(robot, data.free, values, ends, spread)
    phases = tuple((unknown[count:].reshape(len(measured), -1)[:, 0] % 1.0).tolist())
    return RecordedIdentification(estimates, record, phases, scatter, factor, walks.converged)


class _Walks:
    """Computed angles of recorded walks, and derivatives. Unknown are the constants in parts of their ranges, then for
    each walk the phase of the gait, cycles, and the joint angles, rad, at its start."""

    def __init__(self, robot: Robot, free: FreeConstants, recordings: Sequence[Recording]) -> None:
        self.robot, self.free, self.recordings, self.converged = robot, free, recordings, False
        self.given: Array = np.clip(free.parts_of(free.of(robot)), 0.0, 1.0)

    def computed(self, frees: Array) -> list[Array]:
        """Angles of each walk, rad, NaN where they do not count, (samples, sets, N-1), for (sets, unknowns)."""
        count, starts = self.given.size, np.split(frees[:, self.given.size :], len(self.recordings), axis=1)
        out = []
        for one, start in zip(self.recordings, starts, strict=True):
            rows, which = np.unique(np.hstack([frees[:, :count], start]), axis=0, return_inverse=True)
            robots = [self.free.robot_with(self.robot, self.free.values_at(row)) for row in rows[:, :count]]
            robots = [each.set_from_text(one.settings) for each in robots]
            angles = _angles(one.times, robots, rows[:, count:])[:, which]
            out.append(np.where(one.counts[:, None, None], angles, np.nan))
        return out

    def residuals(self, frees: Array) -> Array:
        """Computed less measured angles, then a weak prior: constants less those given, shape (residuals, sets)."""
        pairs = zip(self.computed(frees), self.recordings, strict=True)
        apart = [np.moveaxis(each - one.angles[:, None], 1, 2) for each, one in pairs]
        off = [each[np.isfinite(each[..., 0])] for each in apart]
        return np.vstack([*off, _PRIOR * (frees[:, : self.given.size] - self.given).T])

    def jacobian(self, free: Array) -> Array:
        """Forward differences, backward in the upper half of a range, shape (residuals, unknowns)."""
        steps = np.where(free < 0.5, _STEP, -_STEP)
        off = self.residuals(free + np.vstack([np.zeros(free.size), np.diag(steps)]))
        return (off[:, 1:] - off[:, :1]) / steps

    def covariance(self, free: Array, error: float) -> Array:
        """Covariance of the scaled constants, over that of the angles, with an ``error``, rad. Without any data each
        has a standard deviation of some ranges."""
        slopes = self.jacobian(free)
        slopes[-self.given.size :] *= error / (_OPEN * _PRIOR)
        spread = _inverse(slopes)
        return (spread @ spread.T)[: self.given.size, : self.given.size]

    def fit(self, free: Array, change: float, most: int) -> tuple[float, Array]:
        """Half the sum of squares, and the unknowns, by least squares from a start. The search has also converged where
        the data hardly set phases or angles at the start, along which it creeps, and no constant would move further."""
        ends = np.where(np.arange(free.size) < self.given.size, [[0.0], [1.0]], [[-np.inf], [np.inf]])
        start = np.clip(free, ends[0] + _STEP, ends[1] - _STEP)
        found = least_squares(
            lambda here: self.residuals(here[None])[:, 0], start, self.jacobian, ends, x_scale="jac", ftol=change,
            max_nfev=most,
        )  # fmt: skip
        within = found.active_mask == 0
        rows = _inverse(found.jac[:, within])[: int(within[: self.given.size].sum())]
        error = np.sqrt(2.0 * found.cost / max(found.fun.size - free.size, 1))
        near = np.abs(rows @ found.fun) <= _NEAR * error * np.linalg.norm(rows, axis=1)
        self.converged = found.status > 0 or bool(near.all())
        return float(found.cost), np.asarray(found.x)


def _inverse(slopes: Array) -> Array:
    """Pseudoinverse of derivatives by unknowns, shape (residuals, unknowns), whose units do not matter."""
    sizes = np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)
    inverse: Array = np.linalg.pinv(slopes / sizes, 1e-12) / sizes[:, None]
    return inverse


def _fit(walks: _Walks, progress: Progress) -> Array:
    """Unknowns fitted to each walk alone, then to all together."""
    alone, count = [], walks.given.size
    for at, each in enumerate(walks.recordings):
        progress(0.8 * at / len(walks.recordings), f"phase of {each.name}")
        alone.append(_alone(walks, each))
    progress(0.8, "all walks")
    return walks.fit(np.append(np.median(alone, axis=0)[:count], np.array(alone)[:, count:]), *_FINE)[1]


def _alone(walks: _Walks, recording: Recording) -> Array:
    """Unknowns of one walk: the best fit to its first cycles from several phases goes on with the whole, and so does
    the same half a cycle later, where left and right legs have changed places."""
    period, count = walks.robot.gait.period, walks.given.size
    end = int(np.searchsorted(recording.times, _CYCLES * period))
    first = replace(recording, times=recording.times[:end], angles=recording.angles[:end])
    short, whole = (_Walks(walks.robot, walks.free, [each]) for each in (first, recording))
    early = recording.angles[recording.times <= 0.5 * period]
    start = np.nan_to_num(early).sum(axis=0) / np.maximum(np.isfinite(early).sum(axis=0), 1)
    guesses = [np.concatenate([walks.given, [k / _PHASES], start]) for k in range(_PHASES)]
    _, best = min((short.fit(each, *_ROUGH) for each in guesses), key=lambda fit: fit[0])
    later = best + 0.5 * np.eye(best.size)[count]
    return min((whole.fit(each, *_FINE) for each in (best, later)), key=lambda fit: fit[0])[1]


def _alike(residuals: Array) -> float:
    """Factor by which variances grow where neighbouring residuals, shape (samples, N-1), are alike: the sum of their
    autocorrelation up to its first zero, on both sides."""
    known, off, total = np.isfinite(residuals), np.nan_to_num(residuals), 1.0
    for lag in range(1, len(off) // 2):
        near = (off[lag:] * off[:-lag]).sum() / max((known[lag:] & known[:-lag]).sum(), 1)
        if near <= 0.0:
            break
        total += 2.0 * float(near / (off**2).sum() * known.sum())
    return total


def _angles(times: Array, robots: Sequence[Robot], starts: Array) -> Array:
    """Computed angles, rad, shape (samples, walks, N-1), of a robot and a phase and start for each walk."""
    out, models = np.empty((times.size, len(robots), starts.shape[1] - 1)), [PlanarModel(robot) for robot in robots]
    for gait, phase in {(robot.gait, phase) for robot, phase in zip(robots, starts[:, 0].tolist(), strict=True)}:
        at = [k for k, robot in enumerate(robots) if robot.gait == gait and starts[k, 0] == phase]
        begin, states = phase % 1.0 * gait.period, initial_states(robots[at[0]], starts[at, 1:])
        walked = states_at([models[k] for k in at], states, begin, begin + times, _TOLERANCE)
        out[:, at] = walked[..., 3 : starts.shape[1] + 2]
    return np.nan_to_num(out, nan=_FAR)
