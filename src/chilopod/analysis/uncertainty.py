"""Spread of the onset of instability where the numbers of a robot are uncertain, and the share of each number in it.

Every uncertain number is uniform within its tolerance, independent of the others. The spread is propagated to first
order, with the derivatives of :func:`chilopod.analysis.sensitivity`, and sampled (scipy's scrambled Sobol points). The
shares of the variance are Sobol's first-order and total indices by the estimators of Saltelli et al. (2010, *Computer
Physics Communications* 181, table 2 b and f), with intervals by bootstrap over the samples. A sample that fails, as of
a robot that never bends, is left out of the shares that need it, and counted: shares are then those among robots that
have the quantity.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats.qmc import Sobol

from chilopod import units
from chilopod.analysis.growth import Fate
from chilopod.analysis.quantities import Onset
from chilopod.analysis.sensitivity import sensitivity
from chilopod.errors import ChilopodError, ParameterError
from chilopod.frozen import Array, ReadOnlyArrays
from chilopod.notebook import Summary, axes_for, finite
from chilopod.progress import Progress, part, silent
from chilopod.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEVEL, _SPREAD = 0.95, 0.9  # levels of the intervals of shares, and of that of the onset
_RESAMPLED = 1000
_FEWEST, _MOST = 16, 65536  # samples from which shares are estimated, and that take hours
_SHOWN = 64  # samples from one sign of progress to the next
_WIDE = 0.2  # width of an interval of a share above which more samples are advised


@dataclass(frozen=True, eq=False)
class Shares(ReadOnlyArrays):
    """First-order and total shares of numbers in a variance, shape (numbers,), and their 95 % intervals, shape
    (numbers, 2); NaN where too few samples are left."""

    first: Array
    total: Array
    first_ends: Array
    total_ends: Array


def sobol_shares(f_a: Array, f_b: Array, f_ab: Array, rng: np.random.Generator) -> Shares:
    """Sobol's shares from values of a function at samples A, B, and A with one column from B, shapes (samples,),
    (samples,) and (numbers, samples); NaN for failed samples."""
    found = np.full((6, len(f_ab)), np.nan)
    ends = [0.5 - 0.5 * _LEVEL, 0.5 + 0.5 * _LEVEL]
    for i, mixed in enumerate(f_ab):
        known = np.isfinite(f_a) & np.isfinite(f_b) & np.isfinite(mixed)
        count = int(known.sum())
        if count < _FEWEST:
            continue
        a, b, ab = f_a[known], f_b[known], mixed[known]
        picked = np.vstack([np.arange(count), rng.integers(0, count, (_RESAMPLED, count))])
        variance = np.var(np.concatenate([a[picked], b[picked]], axis=1), axis=1)
        middle = 0.5 * (a.mean() + b.mean())  # centred values have smaller errors
        with np.errstate(invalid="ignore", divide="ignore"):
            first = np.mean((b[picked] - middle) * (ab[picked] - a[picked]), axis=1) / variance
            total = 0.5 * np.mean((a[picked] - ab[picked]) ** 2, axis=1) / variance
        found[:, i] = first[0], total[0], *np.quantile(first[1:], ends), *np.quantile(total[1:], ends)
    return Shares(found[0], found[1], found[2:4].T.copy(), found[4:].T.copy())


@dataclass(frozen=True, eq=False)
class Uncertainty(Summary, ReadOnlyArrays):
    """Spread of the onset, where the straight walk loses stability.

    Attributes
    ----------
    robot, onset, value
        Robot, the number that bends it, and its critical value, SI.
    paths, tolerances
        Paths of the uncertain numbers, and largest deviation of each, SI, shape (numbers,).
    propagated
        Standard deviation of the onset by its derivatives, SI.
    sampled
        Onset in every sample, SI, shape (samples,), NaN where there is none; half are from each set of samples.
    shares, failed, evaluations
        Shares of the numbers in the variance, number of evaluations without an onset, and of all.
    fates
        Number of samples by what the straight walk does beyond the onset.
    """

    robot: Robot
    onset: Onset
    value: float
    paths: tuple[str, ...]
    tolerances: Array
    propagated: float
    sampled: Array
    shares: Shares
    failed: int
    evaluations: int
    fates: Counter[Fate]

    @property
    def deviation(self) -> float:
        """Standard deviation of the samples, SI; NaN for fewer than two."""
        return float(self._known.std(ddof=1)) if self._known.size > 1 else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the central 90 % of the samples, SI; NaN without samples."""
        if not self._known.size:
            return math.nan, math.nan
        low, high = np.quantile(self._known, [0.5 - 0.5 * _SPREAD, 0.5 + 0.5 * _SPREAD]).tolist()
        return low, high

    @property
    def _known(self) -> Array:
        return self.sampled[np.isfinite(self.sampled)]

    def as_json(self) -> dict[str, Any]:
        """Spread and shares as plain numbers, SI; null where unknown."""
        shares = self.shares
        return {
            "robot": self.robot.name,
            "parameter": self.onset.parameter,
            "onset_si": self.value,
            "deviation_propagated_si": self.propagated,
            "deviation_sampled_si": finite(self.deviation),
            "interval_si": [*map(finite, self.interval)],
            "evaluations": self.evaluations,
            "failed": self.failed,
            "fate": self.onset.fate(self.robot, self.value).label,
            "fates": {fate.label: count for fate, count in self.fates.items()},
            "numbers": {
                path: {
                    "tolerance_si": float(self.tolerances[i]),
                    "first_share": finite(shares.first[i]),
                    "first_interval": [*map(finite, shares.first_ends[i])],
                    "total_share": finite(shares.total[i]),
                    "total_interval": [*map(finite, shares.total_ends[i])],
                }
                for i, path in enumerate(self.paths)
            },
        }

    @property
    def title(self) -> str:
        """Onset with its spread."""
        unit = self.robot.unit_of(self.onset.parameter)
        numbers = self.value, self.deviation, self.propagated, *self.interval
        value, deviation, propagated, low, high = (f"{units.from_si(each, unit):.4g}" for each in numbers)
        spread = f"standard deviation {deviation} (to first order {propagated}), 90 % between {low} and {high}"
        value = f"{value} {unit} ({self.onset.fate(self.robot, self.value).label})"
        return f"{self.robot.name}: onset {value}, {spread if self._known.size else 'no sample has one'}"

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        cells: list[Sequence[str]] = [("number", "within ±", "share alone", "with others")]
        shares = self.shares
        for i in np.argsort(-np.nan_to_num(shares.total)).tolist():
            path = self.paths[i]
            within = units.format(float(self.tolerances[i]), self.robot.unit_of(path), digits=4)
            parts = (shares.first[i], *shares.first_ends[i]), (shares.total[i], *shares.total_ends[i])
            alone, jointly = (f"{value:.3f} ({low:.3f} to {high:.3f})" for value, low, high in parts)
            cells.append((path, within, alone, jointly))
        said = f"{self.failed} of {self.evaluations} robots are not possible or have no onset, and do not count"
        below = [said] * bool(self.failed)
        if len(self.fates) > 1:
            counts = ", ".join(f"{fate.label} in {count}" for fate, count in self.fates.most_common())
            below.append(f"beyond the onset the straight walk {counts} robots: spread and shares mix these")
        if self.deviation == 0.0:
            below.append("none of these numbers changes the onset")
        if np.ptp(shares.total_ends, axis=1).max(initial=0.0) > _WIDE:
            below.append("more samples narrow the intervals of the shares")
        return [], cells, below

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the total shares with their intervals, largest on top."""
        axes, shares = axes_for(axes), self.shares
        order = np.argsort(np.nan_to_num(shares.total)).tolist()
        width = np.abs(shares.total_ends[order].T - shares.total[order])
        axes.barh([self.paths[i] for i in order], shares.total[order], xerr=width, color="C0", ecolor="C7")
        axes.set(xlabel="share in the variance of the onset, with others", xlim=(0.0, None), title=self.robot.name)
        return axes


def uncertainty(
    robot: Robot,
    tolerances: Mapping[str, float],
    onset: Onset = Onset(),  # noqa: B008 (frozen)
    samples: int = 128,
    seed: int = 0,
    progress: Progress = silent,
) -> Uncertainty:
    """Spread of the onset for numbers within tolerances. AnalysisError if the robot itself has no onset; ParameterError
    if a number with its tolerance is out of range, such as a negative mass.

    Parameters
    ----------
    robot, onset
        Robot, and the number whose change bends it.
    tolerances
        Largest deviation of each uncertain number, SI, by its path.
    samples, seed
        Number of samples, a power of two to 65536 (numbers + 2 evaluations of a few ms for each, of half a second for
        robots with extreme numbers), and seed of their scrambling.
    """
    _check(robot, tolerances, onset, samples)
    paths, widths = tuple(tolerances), np.array([*tolerances.values()], dtype=np.float64)
    local = sensitivity(robot, onset, ("onset",), paths, part(progress, 0.0, 0.1))
    value = float(local.values[0])
    propagated = float(np.linalg.norm(local.derivatives[0] * widths)) / math.sqrt(3.0)
    rng = np.random.default_rng(seed)
    points = Sobol(2 * widths.size, rng=rng).random(samples)
    deviations = widths * (2.0 * points.reshape(samples, 2, -1) - 1.0)
    centre = np.array([robot.get(path) for path in paths])
    first, second = (centre + deviations[:, half] for half in range(2))
    blocks = [first, second, *(np.where(np.arange(widths.size) == i, second, first) for i in range(widths.size))]
    found, fates = np.full((len(blocks), samples), np.nan), Counter[Fate]()
    for at, numbers in enumerate(np.concatenate(blocks).tolist()):
        if at % samples % _SHOWN == 0:
            progress(0.1 + 0.9 * at / found.size, f"{at} of {found.size} robots")
        with suppress(ChilopodError):  # a robot that is not possible, or has no onset
            sample = robot
            for path, number in zip(paths, numbers, strict=True):
                sample = sample.with_value(path, number)
            found.flat[at] = onset.beside(sample, value)
            if at < 2 * samples:  # independent ones
                fates[onset.fate(sample, float(found.flat[at]))] += 1
    shares, failed = sobol_shares(found[0], found[1], found[2:], rng), int(np.isnan(found).sum())
    sampled = found[:2].ravel()
    return Uncertainty(robot, onset, value, paths, widths, propagated, sampled, shares, failed, found.size, fates)


def _check(robot: Robot, tolerances: Mapping[str, float], onset: Onset, samples: int) -> None:
    """Refuse what :func:`uncertainty` cannot take, with a ParameterError."""
    if not _FEWEST <= samples <= _MOST or samples & (samples - 1):
        allowed = f"a power of two from {_FEWEST} to {_MOST}"
        raise ParameterError("must be a power of two", field="samples", value=samples, allowed=allowed)
    for path, tolerance in tolerances.items():
        if not (math.isfinite(tolerance) and tolerance > 0.0):
            raise ParameterError("must be positive and finite", field=f"tolerance of {path}", value=tolerance)
        for end in (robot.get(path) - tolerance, robot.get(path) + tolerance):
            try:
                robot.with_value(path, end)
            except ChilopodError as error:
                error.problem = f"{path} = {units.format(end, robot.unit_of(path), digits=4)}: {error.problem}"
                error.field, error.value = "tolerances", tolerance
                raise
        if onset.parameter in (path, path.partition("[")[0]):
            said = "must not be the number whose critical value is searched"
            raise ParameterError(said, field="tolerances", value=path)
    if not tolerances:
        raise ParameterError("must name a number", field="tolerances", value="nothing")
