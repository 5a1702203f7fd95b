"""Fit of constants of the planar model to recorded walks, by nonlinear least squares.

Unknown are the free constants and, for each walk, the phase of the gait and the joint angles when the recording begins,
for positions also the pose. Rates are forgotten within a fraction of a step, so each walk begins at rest in its joints
a quarter of a cycle earlier. Derivatives are differences of walks that run together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from chilopod.frozen import Array
from chilopod.kinematics import module_centres, module_headings
from chilopod.planar import PlanarModel, initial_states
from chilopod.planar.sampled import states_at
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.tasks.identify.recordings import Recording

_STEP, _TOLERANCE = 1e-5, 1e-8  # of differences, in units of ranges, cycles, rad and m, and of walks
_EARLIER = 0.25  # cycles from the start of a walk to its first sample
_PHASES, _CYCLES = 6, 10  # number of phases to start from, each tried on so many cycles
_ROUGH, _MOST = (1e-3, 12), (1e-9, 40)  # relative change of the sum of squares that ends a fit, and most steps
_BEST, _APART = 2, 0.1  # number of these phases that are tried on the whole walk, and their distance, cycles
_SCATTER, _FAR = np.deg2rad(0.5), np.pi  # scatter to start from, rad or module lengths, and value after a failure
_ROUNDS, _SAME = 4, 0.01  # of fits with weights from the last one, until these change less


@dataclass(frozen=True, eq=False)
class Fit:
    """Fit of constants to recorded walks.

    Attributes
    ----------
    constants
        Free constants, SI, shape (free,).
    starts
        Phase of the gait at the first sample of each walk, cycles, and its start a quarter of a cycle earlier: joint
        angles, rad, and, for positions, the pose, m and rad.
    noise
        Standard deviation of the residuals of each walk, rad or m, shape (walks,).
    alike
        Factor by which residuals enlarge variances where those of neighbouring samples are alike, shape (walks,).
    fitted
        Computed values of each walk, rad or m, shape (samples, columns).
    slopes
        Derivatives of the residuals, over their noise, over the constants, SI, less what other starts of the walks make
        up for, shape (residuals, free).
    """

    constants: Array
    starts: list[Array]
    noise: Array
    alike: Array
    fitted: list[Array]
    slopes: Array


def fit_recordings(
    robot: Robot,
    ranges: Mapping[str, tuple[float, float]],
    recordings: Sequence[Recording],
    progress: Progress = silent,
) -> Fit:
    """Fit constants within ranges, SI, by their paths: to each walk alone from several phases, then to all together.

    A direction that the data leave open ends near the constants of the robot.
    """
    alone = []
    for at, each in enumerate(recordings):
        progress(0.8 * at / len(recordings), f"phase of {each.name}")
        alone.append(_alone(robot, ranges, each))
    walks, count = _Walks(robot, ranges, recordings), len(ranges)
    free = np.concatenate([np.median([each[:count] for each in alone], axis=0), *(each[count:] for each in alone)])
    for part in range(_ROUNDS):
        progress(0.8 + 0.2 * part / _ROUNDS, "all walks")
        free, before = walks.fit(free, *_MOST)[1], walks.noise
        off = walks.residuals(free)
        numbers = sum(np.isfinite(each).sum() for each in off)
        spread = [np.sqrt(np.nanmean(each**2) * numbers / (numbers - free.size)) for each in off]
        walks.noise = before * spread
        if np.abs(np.array(spread) - 1.0).max() < _SAME:
            break
    scaled, starts = walks.split(free)
    slopes, size = walks.jacobian(free)[:-count], walks.high - walks.low
    over_starts = slopes[:, count:] / np.maximum(np.linalg.norm(slopes[:, count:], axis=0), np.finfo(float).tiny)
    own = slopes[:, :count] - over_starts @ np.linalg.lstsq(over_starts, slopes[:, :count], 1e-9)[0]
    fitted = [each * noise + one.values for each, noise, one in zip(off, before, recordings, strict=True)]
    alike = np.array([_alike(each) for each in off])
    return Fit(walks.low + scaled * size, starts, walks.noise, alike, fitted, own / size)


def _alone(robot: Robot, ranges: Mapping[str, tuple[float, float]], recording: Recording) -> Array:
    """Scaled constants, phase and start of one walk: the best of fits to its first cycles goes on with the whole."""
    count = int(np.searchsorted(recording.times, _CYCLES * robot.gait.period))
    first = replace(recording, times=recording.times[:count], values=recording.values[:count])
    short, whole = (_Walks(robot, ranges, [each]) for each in (first, recording))
    given, start = short.scaled, _first_start(robot, recording)
    fits = [short.fit(np.concatenate([given, [k / _PHASES], start]), *_ROUGH) for k in range(_PHASES)]
    tried: list[tuple[float, Array]] = []
    phases: list[float] = []
    for _, free in sorted(fits, key=lambda fit: fit[0]):
        away = [abs((free[given.size] - other + 0.5) % 1.0 - 0.5) for other in phases]
        if len(tried) < _BEST and min(away, default=1.0) > _APART:
            phases.append(free[given.size])
            tried.append(whole.fit(free, *_MOST))
    return min(tried, key=lambda fit: fit[0])[1]


def _first_start(robot: Robot, recording: Recording) -> Array:
    """Guess of the start of a walk: means over the first half of a cycle, for positions the chain nearest to these."""
    times, values, period = recording.times, recording.values, robot.gait.period

    def mean(begin: float) -> Array:
        part = values[(times >= begin * period) & (times <= (begin + 0.5) * period)]
        known = np.isfinite(part)
        return np.where(
            known.any(axis=0), np.where(known, part, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1), np.nan
        )

    joints, here = robot.body.modules - 1, mean(0.0)
    if not recording.modules:
        return np.nan_to_num(here)
    places, known = here.reshape(-1, 2), np.isfinite(here)
    ahead = np.nan_to_num(np.nanmean(mean(2.0).reshape(-1, 2) - places, axis=0))
    guess = np.concatenate([np.zeros(joints), np.nanmean(places, axis=0), [np.arctan2(ahead[1], ahead[0])]])

    def off(start: Array) -> Array:
        computed = _centres(start[joints:], start[:joints], robot.module_length, recording.modules)
        return np.append((computed - here)[known], _STEP * start[:joints])

    return np.asarray(least_squares(off, guess).x)


def _alike(residuals: Array) -> float:
    """Sum over the autocorrelation of residuals up to its first zero, on both sides, shape (samples, columns)."""
    centred, total = np.nan_to_num(residuals), 1.0
    for lag in range(1, len(centred) // 2):
        pairs = np.isfinite(residuals[lag:] * residuals[:-lag]).sum()
        near = float((centred[lag:] * centred[:-lag]).sum()) / max(pairs, 1) / float(np.nanmean(residuals**2))
        if near <= 0.0:
            break
        total += 2.0 * near
    return total


class _Walks:
    """Residuals of recordings and their derivatives; unknowns are constants in units of their ranges, from the least
    on, then phase and start of each walk."""

    def __init__(
        self, robot: Robot, ranges: Mapping[str, tuple[float, float]], recordings: Sequence[Recording]
    ) -> None:
        self._robot, self._paths, self._recordings = robot, list(ranges), list(recordings)
        self.low, self.high = np.array(list(ranges.values())).T
        given = np.array([robot.get(path) for path in self._paths])
        self.scaled: Array = np.clip((given - self.low) / (self.high - self.low), 0.0, 1.0)
        self.noise = np.array([_SCATTER * (robot.module_length if each.modules else 1.0) for each in recordings])

    def split(self, free: Array) -> tuple[Array, list[Array]]:
        """Scaled constants, and phase and start of each walk."""
        count, joints = len(self._paths), self._robot.body.modules - 1
        sizes = [1 + joints + (3 if each.modules else 0) for each in self._recordings]
        return free[:count], np.split(free[count:], np.cumsum(sizes)[:-1])

    def with_constants(self, scaled: Array) -> Robot:
        robot = self._robot
        for path, value in zip(self._paths, self.low + scaled * (self.high - self.low), strict=True):
            robot = robot.with_value(path, float(value))
        return robot

    def residuals(self, free: Array) -> list[Array]:
        """Residuals of each walk over its noise, NaN in gaps."""
        scaled, starts = self.split(free)
        robot, each = self.with_constants(scaled), zip(self._recordings, starts, self.noise, strict=True)
        return [
            (_values(one, [robot.set_from_text(one.settings)], start[None])[:, 0] - one.values) / noise
            for one, start, noise in each
        ]

    def __call__(self, free: Array) -> Array:
        """Residuals in a row, then the constants less those of the robot: a weak prior on what the data leave open."""
        known = [each[np.isfinite(each)] for each in self.residuals(free)]
        return np.concatenate([*known, free[: self.scaled.size] - self.scaled])

    def jacobian(self, free: Array) -> Array:
        """Forward differences, backward in the upper half of a range, shape (residuals, unknowns)."""
        scaled, starts = self.split(free)
        count, column = scaled.size, scaled.size
        steps = np.where(scaled < 0.5, _STEP, -_STEP)
        robots = [self.with_constants(scaled + move) for move in np.vstack([np.zeros(count), np.diag(steps)])]
        rows = []
        for one, start, noise in zip(self._recordings, starts, self.noise, strict=True):
            own, size = [robot.set_from_text(one.settings) for robot in robots], start.size
            moved = np.vstack([np.tile(start, (count + 1, 1)), start + _STEP * np.eye(size)])
            values = np.moveaxis(_values(one, [*own, *own[:1] * size], moved), 1, 2)[np.isfinite(one.values)]
            slopes = (values[:, 1:] - values[:, :1]) / np.append(steps, np.full(size, _STEP)) / noise
            rows.append(np.zeros((len(slopes), free.size)))
            rows[-1][:, :count], rows[-1][:, column : column + size] = slopes[:, :count], slopes[:, count:]
            column += size
        return np.vstack([*rows, np.eye(count, free.size)])

    def fit(self, free: Array, change: float, most: int) -> tuple[float, Array]:
        """Half the sum of squares, and the unknowns, by least squares from a start."""
        ends = np.where(np.arange(free.size) < self.scaled.size, [[0.0], [1.0]], [[-np.inf], [np.inf]])
        start = np.clip(free, ends[0] + 1e-6, ends[1] - 1e-6)
        found = least_squares(self, start, self.jacobian, ends, x_scale="jac", ftol=change, max_nfev=most)
        return float(found.cost), np.asarray(found.x)


def _values(recording: Recording, robots: Sequence[Robot], starts: Array) -> Array:
    """Computed values of a recording, shape (samples, walks, columns), of a robot and a phase and start each."""
    out = np.empty((recording.times.size, len(robots), recording.values.shape[1]))
    together: dict[tuple[object, float], list[int]] = {}
    for at, (robot, start) in enumerate(zip(robots, starts, strict=True)):
        together.setdefault((robot.gait, float(start[0])), []).append(at)
    for (_, phase), walks in together.items():
        own, joints = [robots[at] for at in walks], robots[0].body.modules - 1
        states = initial_states(own[0], starts[walks, 1 : joints + 1])
        if recording.modules:
            states[:, -3:] = starts[walks, joints + 1 :]
        begin = (phase % 1.0) * own[0].gait.period
        times = begin + _EARLIER * own[0].gait.period + recording.times
        walked = states_at([PlanarModel(robot) for robot in own], states, begin, times, _TOLERANCE)
        angles = walked[..., 3 : joints + 3]
        lengths = np.array([robot.module_length for robot in own])[:, None, None]
        out[:, walks] = _centres(walked[..., -3:], angles, lengths, recording.modules) if recording.modules else angles
    return np.nan_to_num(out, nan=_FAR)


def _centres(poses: Array, angles: Array, length: Array | float, modules: Sequence[int]) -> Array:
    """Positions x and y of some modules in a row, m, shape (..., 2 * modules), from poses and joint angles."""
    centres = module_centres(poses[..., :2], module_headings(poses[..., 2], angles), length)
    return centres[..., np.array(modules) - 1, :].reshape(*poses.shape[:-1], -1)
