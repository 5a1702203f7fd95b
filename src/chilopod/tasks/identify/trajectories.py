"""Identification of constants of the planar model from recorded walks, by nonlinear least squares.

Unknown are the free constants and, for each walk, the phase of the gait and the joint angles when the recording begins.
Rates are forgotten within a fraction of a step, so each walk begins at rest in its joints a quarter of a cycle earlier.
Derivatives are differences of walks that run together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.optimize import least_squares
from scipy.special import stdtrit

from chilopod import units
from chilopod.frozen import Array
from chilopod.notebook import Shown, aligned
from chilopod.planar import PlanarModel, initial_states
from chilopod.planar.sampled import states_at
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.tasks.identify.planar_fit import CONFIDENCE
from chilopod.tasks.identify.recordings import RecordedWalks, Recording

_STEP, _TOLERANCE = 1e-5, 1e-8  # of differences, in units of ranges, cycles and rad, and of walks
_EARLIER, _FAR = 0.25, np.pi  # cycles from the start of a walk to its first sample, and angles after it has failed, rad
_PHASES, _CYCLES = 6, 10  # number of phases to start from, each tried on so many cycles
_ROUGH, _FINE = (1e-3, 12), (1e-9, 40)  # change of the sum of squares, relative, that ends a fit, and most steps
_PRIOR = 1e-3  # weight of constants as given, in rad for a range
_OPEN, _ALIKE = 0.5, 2.0  # half of an interval, in ranges, that leaves a constant open, and factor that is said
_SMALL = 0.02  # change in a combination that is not said, over the largest


@dataclass(frozen=True)
class RecordedIdentification(Shown):
    """Result of an identification from recorded walks.

    ``best`` is the robot with the best constants, and their 90 % intervals as provenance. ``found`` has these as
    numbers and text, correlations, independent combinations (relative changes of the constants by half of the 90 %
    interval along each), the scatter of the residuals, rad, and the factor by which variances grow where neighbouring
    residuals are alike. ``walks`` has measured and fitted joint angles, rad.
    """

    best: Robot
    found: dict[str, Any]
    walks: xr.Dataset

    def lines(self) -> list[str]:
        """Constants with intervals, and combinations, as lines of text."""
        level, scatter = f"{CONFIDENCE:.0%} interval", np.rad2deg(self.found["scatter_rad"])
        rows = [(path, each["text"], each["interval_text"]) for path, each in self.found["constants"].items()]
        said = [f"residuals of {int(self.walks.measured.count())} joint angles scatter by {scatter:.3g} deg"]
        said += [*aligned([("constant", "best", level), *rows]), f"independent combinations, by half of their {level}:"]
        for each in self.found["combinations"]:
            least = _SMALL * max(map(abs, each["changes"].values()))
            texts = [f"{path} {100.0 * x:+.2g} %" for path, x in each["changes"].items() if abs(x) > least]
            said.append(f"  {', '.join(texts)}{' (left open)' if each['open'] else ''}")
        if not self.found["converged"]:
            said.append(f"the search ended after {_FINE[1]} steps, before it converged")
        if (factor := self.found["variance_factor"]) > _ALIKE:
            wide = f"intervals are {np.sqrt(factor):.1f} times as wide as those of independent ones"
            said.append(f"neighbouring residuals are alike: the model or the recording is off; {wide}")
        return said

    _lines = lines


def identify_recorded(
    robot: Robot, data: RecordedWalks, folder: Path, progress: Progress = silent
) -> RecordedIdentification:
    """Fit the free constants of a robot to recorded walks from files in a folder.

    Intervals are those of linear residuals with the scatter that is left. Directions that the data leave open end near
    the constants of the robot. Errors are those of :class:`RecordedWalks`.
    """
    walks = _Walks(robot, data.ranges(robot), data.recordings(robot, folder))
    free, count = _fit(walks, progress), len(walks.ranges)
    fitted, measured = [each[:, 0] for each in walks.computed(free[None])], [each.angles for each in walks.recordings]
    off = np.concatenate([(one - other)[np.isfinite(other)] for one, other in zip(fitted, measured, strict=True)])
    factor = max(_alike(one - other) for one, other in zip(fitted, measured, strict=True))
    scatter = float(np.linalg.norm(off) / np.sqrt(off.size - free.size))
    covariance = factor * scatter**2 * walks.covariance(free)
    wide = float(stdtrit(max(off.size / factor - free.size, 1.0), 0.5 + 0.5 * CONFIDENCE))
    best, half = walks.with_constants(free[:count]), wide * np.sqrt(np.diag(covariance))
    constants = {path: _constant(best, path, walks, at, free[at], half[at]) for at, path in enumerate(walks.ranges)}
    sizes = walks.size / np.abs([best.get(path) or size for path, size in zip(walks.ranges, walks.size, strict=True)])
    values, directions = np.linalg.eigh(covariance * np.outer(sizes, sizes))
    changes = wide * np.sqrt(np.abs(values)) * directions * np.where(directions.sum(axis=0) < 0.0, -1.0, 1.0)
    opens = (np.abs(changes) > _OPEN * sizes[:, None]).any(axis=0).tolist()
    named = [dict(zip(walks.ranges, each, strict=True)) for each in changes.T.tolist()]
    found = {
        "constants": constants,
        "correlations": (covariance * np.outer(wide / half, wide / half)).tolist(),
        "combinations": [{"changes": one, "open": is_open} for one, is_open in zip(named, opens, strict=True)],
        "scatter_rad": scatter,
        "variance_factor": factor,
        "converged": walks.converged,
    }
    files = ", ".join(each.name for each in walks.recordings)
    texts = {path: f"identified from {files}; 90 %: {each['interval_text']}" for path, each in constants.items()}
    times = np.concatenate([each.times for each in walks.recordings])
    number = np.repeat(range(len(measured)), [len(each) for each in measured])
    record = xr.Dataset(coords={"time": ("sample", times, {"units": "s"}), "walk": ("sample", number)})
    for name, angles in (("measured", measured), ("fitted", fitted)):
        record[name] = ("sample", "joint"), np.vstack(angles), {"units": "rad"}
    return RecordedIdentification(best.with_(provenance={**best.provenance, **texts}), found, record)


def _constant(best: Robot, path: str, walks: _Walks, at: int, scaled: float, half: float) -> dict[str, Any]:
    """Best value of a constant and its interval."""
    ends = (walks.low[at] + walks.size[at] * np.clip([scaled - half, scaled + half], 0.0, 1.0)).tolist()
    text, *limits = (units.format(each, best.unit_of(path), digits=5) for each in (best.get(path), *ends))
    cut = " (cut by the range searched)" if half > min(scaled, 1.0 - scaled) else ""
    is_open = bool(half > _OPEN)
    known = "left open by the walks" if is_open else f"{limits[0]} to {limits[1]}{cut}"
    return {"value_si": best.get(path), "text": text, "interval_si": None if is_open else ends, "interval_text": known}


class _Walks:
    """Computed angles of recorded walks, and derivatives. Unknown are the constants in units of their ranges, from the
    least value on, then for each walk the phase of the gait, cycles, and the joint angles, rad, at its start."""

    def __init__(
        self, robot: Robot, ranges: Mapping[str, tuple[float, float]], recordings: Sequence[Recording]
    ) -> None:
        self.robot, self.ranges, self.recordings, self.converged = robot, ranges, recordings, False
        self.low, high = np.array(list(ranges.values())).T
        self.size: Array = high - self.low
        self.given: Array = np.clip(([robot.get(path) for path in ranges] - self.low) / self.size, 0.0, 1.0)

    def with_constants(self, scaled: Array) -> Robot:
        robot = self.robot
        for path, value in zip(self.ranges, self.low + scaled * self.size, strict=True):
            robot = robot.with_value(path, float(value))
        return robot

    def computed(self, frees: Array) -> list[Array]:
        """Angles of each walk, rad, shape (samples, sets, N-1), with sets of unknowns, shape (sets, unknowns)."""
        count, starts = self.given.size, np.split(frees[:, self.given.size :], len(self.recordings), axis=1)
        out = []
        for one, start in zip(self.recordings, starts, strict=True):
            rows, which = np.unique(np.hstack([frees[:, :count], start]), axis=0, return_inverse=True)
            robots = [self.with_constants(row).set_from_text(one.settings) for row in rows[:, :count]]
            out.append(_angles(one.times, robots, rows[:, count:])[:, which])
        return out

    def residuals(self, frees: Array) -> Array:
        """Computed less measured angles, then a weak prior: constants less those given, shape (residuals, sets)."""
        pairs = zip(self.computed(frees), self.recordings, strict=True)
        off = [np.moveaxis(each - one.angles[:, None], 1, 2)[np.isfinite(one.angles)] for each, one in pairs]
        return np.vstack([*off, _PRIOR * (frees[:, : self.given.size] - self.given).T])

    def jacobian(self, free: Array) -> Array:
        """Forward differences, backward in the upper half of a range, shape (residuals, unknowns)."""
        steps = np.where(free < 0.5, _STEP, -_STEP)
        off = self.residuals(free + np.vstack([np.zeros(free.size), np.diag(steps)]))
        return (off[:, 1:] - off[:, :1]) / steps

    def covariance(self, free: Array) -> Array:
        """Covariance of the scaled constants for residuals of unit variance."""
        slopes = self.jacobian(free)
        sizes = np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)
        spread = np.linalg.pinv(slopes / sizes, 1e-9) / sizes[:, None]
        return (spread @ spread.T)[: self.given.size, : self.given.size]

    def fit(self, free: Array, change: float, most: int) -> tuple[float, Array]:
        """Half the sum of squares, and the unknowns, by least squares from a start."""
        ends = np.where(np.arange(free.size) < self.given.size, [[0.0], [1.0]], [[-np.inf], [np.inf]])
        start = np.clip(free, ends[0] + _STEP, ends[1] - _STEP)
        found = least_squares(
            lambda here: self.residuals(here[None])[:, 0], start, self.jacobian, ends, x_scale="jac", ftol=change,
            max_nfev=most,
        )  # fmt: skip
        self.converged = found.status > 0
        return float(found.cost), np.asarray(found.x)


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
    short, whole = (_Walks(walks.robot, walks.ranges, [each]) for each in (first, recording))
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
        moments = begin + _EARLIER * gait.period + times
        walked = states_at([models[k] for k in at], states, begin, moments, _TOLERANCE)
        out[:, at] = walked[..., 3 : starts.shape[1] + 2]
    return np.nan_to_num(out, nan=_FAR)
