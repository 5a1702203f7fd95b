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
_EARLIER = 0.25  # cycles from the start of a walk to its first sample
_PHASES, _CYCLES = 6, 10  # number of phases to start from, each tried on so many cycles
_ROUGH, _FINE = (1e-3, 12), (1e-9, 40)  # change of the sum of squares, relative, that ends a fit, and most steps
_SCATTER, _FAR = np.deg2rad(0.5), np.pi  # of angles, first guess, and angle of a walk that has failed
_OPEN = 0.5  # half of an interval, in units of the range, from which on a constant is left open
_SMALL, _ALIKE = 0.02, 2.0  # change that is not said, over the largest, and factor of the variance that is said


@dataclass(frozen=True)
class RecordedIdentification(Shown):
    """Result of an identification from recorded walks.

    ``best`` is the robot with the best constants, and their 90 % intervals as provenance. ``found`` has these
    constants and intervals (None where the walks leave a constant open), correlations, independent combinations (the
    relative changes of the constants by half of the 90 % interval along each), the scatter of the residuals, rad, and
    the factor by which it enlarges variances where neighbours are alike. ``walks`` has measured and fitted angles, rad.
    """

    best: Robot
    found: dict[str, Any]
    walks: xr.Dataset

    def as_json(self) -> dict[str, Any]:
        """What was found, as plain numbers and text."""
        return self.found

    def lines(self) -> list[str]:
        """Constants with intervals, and combinations, as lines of text."""
        rows = [(path, each["text"], each["interval_text"]) for path, each in self.found["constants"].items()]
        scatter, count = np.rad2deg(self.found["scatter_rad"]), int(self.walks.measured.count())
        said = [f"{self.best.name}: residuals of {count} joint angles scatter by {scatter:.3g} deg"]
        said += aligned([("constant", "best", f"{CONFIDENCE:.0%} interval"), *rows])
        said += [f"the range searched ends the interval of {path}" for path in self.found["cut_by_the_range"]]
        said.append(f"independent combinations, each by half of its {CONFIDENCE:.0%} interval:")
        for each in self.found["combinations"]:
            changes, least = each["changes"], _SMALL * max(map(abs, each["changes"].values()))
            texts = (f"{path} {100.0 * change:+.2g} %" for path, change in changes.items() if abs(change) > least)
            said.append(f"  {', '.join(texts)}{' (left open)' if each['open'] else ''}")
        if (factor := self.found["variance_factor"]) > _ALIKE:
            widened = f"intervals are {np.sqrt(factor):.1f} times as wide as those of independent ones"
            said.append(f"neighbouring residuals are alike: the model or the recording is off; {widened}")
        return said

    _lines = lines


def identify_recorded(
    robot: Robot, data: RecordedWalks, folder: Path, progress: Progress = silent
) -> RecordedIdentification:
    """Fit the free constants of a robot to recorded walks from files in a folder.

    Variances are those of linear residuals with the scatter that is left. Directions that the data leave open end near
    the constants of the robot. Errors as of :class:`RecordedWalks`.
    """
    walks = _Walks(robot, data.ranges(robot), data.recordings(robot, folder))
    free, count = _fit(walks, progress), len(walks.ranges)
    fitted, measured = walks.fitted(free), [each.angles for each in walks.recordings]
    factor = max(_alike(one - other) for one, other in zip(fitted, measured, strict=True))
    wide = float(stdtrit(np.isfinite(np.vstack(measured)).sum() / factor - free.size, 0.5 + 0.5 * CONFIDENCE))
    covariance = factor * walks.covariance(free)
    scatter, half = np.sqrt(np.diag(covariance)), wide * np.sqrt(np.diag(covariance))
    ends = free[:count, None] + half[:, None] * [-1.0, 1.0]
    spans = walks.low[:, None] + walks.size[:, None] * np.clip(ends, 0.0, 1.0)
    best, constants = walks.with_constants(free[:count]), {}
    for at, path in enumerate(walks.ranges):
        text, *limits = (units.format(x, best.unit_of(path), digits=5) for x in (best.get(path), *spans[at].tolist()))
        known, words = (spans[at].tolist(), " to ".join(limits)) if half[at] < _OPEN else (None, "left open")
        constants[path] = {"value_si": best.get(path), "text": text, "interval_si": known, "interval_text": words}
    sizes = walks.size / np.abs([best.get(path) or size for path, size in zip(walks.ranges, walks.size, strict=True)])
    values, directions = np.linalg.eigh(covariance * np.outer(sizes, sizes))
    changes = (wide * np.sqrt(np.abs(values)) * directions * np.where(directions.sum(axis=0) < 0.0, -1.0, 1.0)).T
    found = {
        "constants": constants,
        "cut_by_the_range": [
            path for path, each in zip(walks.ranges, ends, strict=True) if (np.clip(each, 0, 1) != each).any()
        ],
        "correlations": (covariance / np.outer(scatter, scatter)).tolist(),
        "combinations": [
            {
                "changes": dict(zip(walks.ranges, each.tolist(), strict=True)),
                "open": bool((np.abs(each) > _OPEN * sizes).any()),
            }
            for each in changes
        ],
        "scatter_rad": walks.scatter,
        "variance_factor": factor,
        "phases_of_the_first_samples_cycles": ((walks.starts(free)[:, 0] + _EARLIER) % 1.0).tolist(),
    }
    files = ", ".join(each.name for each in walks.recordings)
    texts = {
        path: f"identified from {files}; {CONFIDENCE:.0%}: {each['interval_text']}" for path, each in constants.items()
    }
    angles = {
        name: (("sample", "joint"), np.vstack(each), {"units": "rad"})
        for name, each in (("measured", measured), ("fitted", fitted))
    }
    coords = {
        "time": ("sample", np.concatenate([each.times for each in walks.recordings]), {"units": "s"}),
        "walk": ("sample", np.repeat(range(len(measured)), [len(each) for each in measured])),
    }
    best = best.with_(provenance={**best.provenance, **texts})
    return RecordedIdentification(best, found, xr.Dataset(angles, coords))


class _Walks:
    """Residuals of recorded walks over their scatter, and derivatives.

    Unknown are the constants in units of their ranges, from the least value on, then the phase of the gait at the start
    of each walk, cycles, and its joint angles there, rad.
    """

    def __init__(
        self, robot: Robot, ranges: Mapping[str, tuple[float, float]], recordings: Sequence[Recording]
    ) -> None:
        self.robot, self.ranges, self.recordings, self.scatter = robot, ranges, recordings, _SCATTER
        self.low, high = np.array(list(ranges.values())).T
        self.size = high - self.low
        self.given: Array = np.clip(([robot.get(path) for path in ranges] - self.low) / self.size, 0.0, 1.0)

    def with_constants(self, scaled: Array) -> Robot:
        robot = self.robot
        for path, value in zip(self.ranges, self.low + scaled * self.size, strict=True):
            robot = robot.with_value(path, float(value))
        return robot

    def starts(self, free: Array) -> Array:
        """Phase and joint angles at the start of each walk, shape (walks, N)."""
        return free[self.given.size :].reshape(len(self.recordings), -1)

    def fitted(self, free: Array) -> list[Array]:
        """Computed angles of each walk, rad, shape (samples, N-1)."""
        robot, walks = (
            self.with_constants(free[: self.given.size]),
            zip(self.recordings, self.starts(free), strict=True),
        )
        return [_angles(each, [robot], start[None])[:, 0] for each, start in walks]

    def residuals(self, free: Array) -> Array:
        """Residuals in a row, then the constants less those of the robot: a weak prior on what the data leave open."""
        off = [each - one.angles for each, one in zip(self.fitted(free), self.recordings, strict=True)]
        known = np.concatenate([each[np.isfinite(each)] for each in off])
        return np.append(known / self.scatter, free[: self.given.size] - self.given)

    def jacobian(self, free: Array) -> Array:
        """Forward differences, backward in the upper half of a range, shape (residuals, unknowns)."""
        count, starts = self.given.size, self.starts(free)
        steps = np.where(free < 0.5, _STEP, -_STEP)
        robots = [self.with_constants(free[:count] + move) for move in np.diag(steps[:count])]
        here, blocks, each = self.with_constants(free[:count]), [], starts.shape[1]
        for at, one in enumerate(self.recordings):
            own = slice(count + at * each, count + (at + 1) * each)
            moved = starts[at] + np.vstack([np.zeros((count + 1, each)), np.diag(steps[own])])
            angles = _angles(one, [here, *robots, *[here] * each], moved)
            slopes = np.moveaxis(angles[:, 1:] - angles[:, :1], 1, 2)[np.isfinite(one.angles)] / self.scatter
            blocks.append(np.zeros((len(slopes), free.size)))
            blocks[-1][:, :count], blocks[-1][:, own] = (
                slopes[:, :count] / steps[:count],
                slopes[:, count:] / steps[own],
            )
        return np.vstack([*blocks, np.eye(count, free.size)])

    def covariance(self, free: Array) -> Array:
        """Covariance of the constants in units of their ranges, with the weak prior."""
        slopes = self.jacobian(free)
        sizes = np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)
        spread = np.linalg.pinv(slopes / sizes, 1e-9) / sizes[:, None]
        return (spread @ spread.T)[: self.given.size, : self.given.size]

    def fit(self, free: Array, change: float, most: int) -> tuple[float, Array]:
        """Half the sum of squares, and the unknowns, by least squares from a start."""
        ends = np.where(np.arange(free.size) < self.given.size, [[0.0], [1.0]], [[-np.inf], [np.inf]])
        start = np.clip(free, ends[0] + _STEP, ends[1] - _STEP)
        found = least_squares(self.residuals, start, self.jacobian, ends, x_scale="jac", ftol=change, max_nfev=most)
        return float(found.cost), np.asarray(found.x)


def _fit(walks: _Walks, progress: Progress) -> Array:
    """Unknowns fitted to each walk alone, then to all together, twice, with the scatter that the first fit leaves."""
    alone, count = [], walks.given.size
    for at, each in enumerate(walks.recordings):
        progress(0.8 * at / len(walks.recordings), f"phase of {each.name}")
        alone.append(_alone(walks, each))
    free = np.append(np.median(alone, axis=0)[:count], np.array(alone)[:, count:])
    for part in range(2):
        progress(0.8 + 0.1 * part, "all walks")
        free = walks.fit(free, *_FINE)[1]
        off = walks.residuals(free)[:-count]
        walks.scatter *= float(np.linalg.norm(off) / np.sqrt(off.size - free.size))
    return free


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
    half_later = best + 0.5 * np.eye(best.size)[count]
    return min((whole.fit(each, *_FINE) for each in (best, half_later)), key=lambda fit: fit[0])[1]


def _alike(residuals: Array) -> float:
    """Factor by which residuals, shape (samples, N-1), enlarge variances where neighbouring ones are alike: the sum of
    their autocorrelation up to its first zero, on both sides."""
    known, off, total = np.isfinite(residuals), np.nan_to_num(residuals), 1.0
    for lag in range(1, len(off) // 2):
        near = (off[lag:] * off[:-lag]).sum() / max((known[lag:] & known[:-lag]).sum(), 1)
        if near <= 0.0:
            break
        total += 2.0 * float(near / (off**2).sum() * known.sum())
    return total


def _angles(recording: Recording, robots: Sequence[Robot], starts: Array) -> Array:
    """Computed angles, rad, shape (samples, walks, N-1), of a robot and a phase and start for each walk."""
    out = np.empty((recording.times.size, len(robots), starts.shape[1] - 1))
    models = [PlanarModel(robot.set_from_text(recording.settings)) for robot in robots]
    for gait, phase in {(model.robot.gait, phase) for model, phase in zip(models, starts[:, 0].tolist(), strict=True)}:
        at = [k for k, model in enumerate(models) if model.robot.gait == gait and starts[k, 0] == phase]
        begin, states = phase % 1.0 * gait.period, initial_states(models[at[0]].robot, starts[at, 1:])
        times = begin + _EARLIER * gait.period + recording.times
        states = states_at([models[k] for k in at], states, begin, times, _TOLERANCE)
        out[:, at] = states[..., 3 : starts.shape[1] + 2]
    return np.nan_to_num(out, nan=_FAR)
