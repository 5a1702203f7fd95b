"""Radius of the settled curved walk over one parameter, and its inverse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from chilopod import units
from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import Array, ReadOnlyArrays


@dataclass(frozen=True, eq=False)
class RadiusLaw(ReadOnlyArrays):
    """Radius of the stable curved walks below the pitchfork, as long as it falls with the parameter.

    The squared curvature 1/r^2 is interpolated: it leaves zero linearly at the pitchfork, where the radius itself is
    infinite and has no slope.

    Attributes
    ----------
    values, radii
        Values of the parameter, rising, SI units, the last one the pitchfork, and radii, m, infinite there, shape
        (points,).
    unit
        Unit of the values in messages.
    """

    values: Array
    radii: Array
    unit: str

    def __post_init__(self) -> None:
        if not (len(self.values) >= 3 and (np.diff(self.values) > 0.0).all() and (np.diff(self.radii) > 0.0).all()):
            raise ParameterError("a radius law needs three points or more, rising in value and radius", field="radii")
        super().__post_init__()

    @classmethod
    def of_branch(cls, values: ArrayLike, radii: ArrayLike, stable: ArrayLike, unit: str) -> RadiusLaw:
        """Build the law from a branch of curved walks that starts at its pitchfork: parameter in SI units, radius in m
        and stability of the walk along the branch, from the pitchfork (included) on, shape (points,); and unit of the
        values in messages. AnalysisError if the walks beside the pitchfork are not stable or do not tighten as the
        parameter falls, so that no spring sets the radius of a turn."""
        values, radii, stable = np.asarray(values, float), np.asarray(radii, float), np.asarray(stable, bool)
        curvature = np.where(np.isfinite(radii), 1.0 / radii, 0.0)
        good = stable[1:] & (np.diff(values) < 0.0) & (np.diff(curvature) > 0.0)
        count = 1 + (len(good) if good.all() else int(np.argmin(good)))
        if count < 3:
            problem = "beside the pitchfork the curved walks do not tighten, and no spring sets a radius"
            if not stable[1:3].all():
                problem = "beside the pitchfork the curved walks are unstable, and the robot jumps"
                problem = f"subcritical: {problem}" if values[1] > values[0] else problem
            raise AnalysisError(problem, field="branch")
        bent = np.concatenate([[np.inf], radii[1:count]])
        return cls(values[:count][::-1], bent[::-1], unit)

    @property
    def pitchfork(self) -> float:
        """Value at which the radius becomes infinite, SI units."""
        return float(self.values[-1])

    @property
    def tightest(self) -> float:
        """Smallest radius of the law, m."""
        return float(self.radii[0])

    def radius(self, value: float) -> float:
        """Radius at a value of the parameter (SI), m; infinite from the pitchfork on, ParameterError below the law."""
        if value >= self.pitchfork:
            return float("inf")
        if not value >= self.values[0]:
            lowest = units.format(float(self.values[0]), self.unit, digits=4)
            shown = units.format(value, self.unit, digits=4)
            problem = "must be at least the smallest value of the radius law"
            raise ParameterError(problem, field="value", value=shown, allowed=f"{lowest} and more")
        return float(1.0 / np.sqrt(self._squared_curvature(value)))

    def value(self, radius: float) -> float:
        """Value of the parameter (SI) that gives a radius (m), the paper's k1-hat; AnalysisError if none does."""
        from scipy.optimize import brentq

        if not radius >= self.tightest:
            softest = units.format(float(self.values[0]), self.unit, digits=4)
            allowed = f"{self.tightest:.4g} m (at {softest}) and more"
            problem = "must be at least the tightest radius of the law"
            raise AnalysisError(problem, field="radius", value=f"{radius:.4g} m", allowed=allowed)
        if np.isinf(radius):
            return self.pitchfork
        wanted = 1.0 / radius**2
        low, high = float(self.values[0]), self.pitchfork
        return float(brentq(lambda value: self._squared_curvature(value) - wanted, low, high, xtol=1e-12 * high))

    def _squared_curvature(self, value: float) -> float:
        from scipy.interpolate import PchipInterpolator

        return float(PchipInterpolator(self.values, 1.0 / self.radii**2)(value))
