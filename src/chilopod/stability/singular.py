"""The orbit at a multiplier +1 of the return map H, where H - 1 is singular, from the orbits beside it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.stability.floquet import spectrum
from chilopod.stability.orbits import Orbit, bounded
from chilopod.stability.samples import Sample, Samples
from chilopod.stability.unit_circle.crossings import Crossing
from chilopod.stability.unit_circle.spectra import Event

Array = NDArray[np.float64]

_SAFETY = 1.5
_NODES = np.array([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0]) / 4.0
_REACH, _LEAST_REACH = 0.02, 1e-5  # of the interval, to either side
_SHORTER = 0.25
_AGREES = 1e-6  # of the reach, between two interpolations
_AT_HOME = 0.01  # of the reach, from where the root finder saw the point
_REAL = 1e-3


def past_singular(samples: Samples, crossing: Crossing) -> tuple[float, float, Orbit] | None:
    """Value, its error bound and the orbit at a multiplier +1 of an orbit that is followed.

    There H - 1 is singular, and Newton's method stops anywhere along the mode where the residual is round-off; so the
    orbit and its critical multiplier are interpolated from places to both sides where that is not so. They are taken
    closer together until interpolations of two orders agree: not far off the multiplier may meet another one, and is
    no smooth function then. None where it is not singular, or there is no room.
    """
    if samples.known or crossing.event is not Event.PLUS or crossing.multiplicity > 1 or crossing.collision:
        return None
    best: tuple[float, float, _Interpolation] | None = None
    for reach in _reaches(samples, crossing):
        found = _interpolated(samples, crossing, reach)
        if found is None:
            continue
        # Where they do not agree, the root finder's value is not to be thrown away.
        far = 0.0 if found.converged else abs(found.place)
        bound = reach * (found.between + far)
        if best is None or bound < best[0]:
            best = bound, reach, found
        if found.converged:
            break
    if best is None:
        return None
    bound, reach, found = best
    value = crossing.value + reach * found.place
    orbit = bounded(samples.family(value), found.orbit, found.beside.image, error=found.orbit_error)
    spec = spectrum(orbit.image)
    uncertain = float(spec.error[np.abs(spec.values - 1.0).argmin()])
    return value, bound + _SAFETY * uncertain * reach / found.slope, orbit


def _reaches(samples: Samples, crossing: Crossing) -> Iterator[float]:
    reach = min(_REACH * samples.width, crossing.value - samples.low, samples.end - crossing.value)
    while reach >= _LEAST_REACH * samples.width:
        yield reach
        reach *= _SHORTER


class _Interpolation:
    """Polynomials through the critical multiplier and the orbit at all nodes, and at all but the outermost.

    Attributes
    ----------
    place, between
        Of the multiplier +1, and how far apart both polynomials have it; in units of the reach from the middle.
    slope
        Of the multiplier, per reach.
    orbit, orbit_error
        There, shape (n,).
    beside
        A sample next to it.
    """

    def __init__(self, beside: list[Sample], fine: Polynomial, roots: list[float]) -> None:
        self.place, self.between = roots[0], abs(roots[0] - roots[1])
        self.slope = abs(float(fine.deriv()(self.place)))
        columns = np.array([each.orbit for each in beside]).T
        fits = [np.array([_fit(column, part)(self.place) for column in columns]) for part in _parts()]
        self.orbit: Array = fits[0]
        self.orbit_error: Array = np.abs(fits[0] - fits[1])
        self.beside = beside[_NODES.size // 2 - 1]

    @property
    def converged(self) -> bool:
        return self.between <= _AGREES and abs(self.place) <= _AT_HOME


def _interpolated(samples: Samples, crossing: Crossing, reach: float) -> _Interpolation | None:
    try:
        beside = samples.at(crossing.value + reach * _NODES)
    except AnalysisError:
        return None
    spectra = [spectrum(each.image).values for each in beside]
    # The multiplier nearest +1 in the middle, followed outward by how much it moves from node to node.
    values = np.empty(_NODES.size)
    middle = _NODES.size // 2
    for side in (range(middle - 1, -1, -1), range(middle, _NODES.size)):
        expected = 1.0
        for i in side:
            real = spectra[i][np.abs(spectra[i].imag) < _REAL].real
            if not real.size:
                return None
            values[i] = real[np.abs(real - expected).argmin()]
            expected = values[i] + (values[i] - 1.0) / (middle * abs(_NODES[i]))
    fine, coarse = (_fit(values - 1.0, part) for part in _parts())
    roots = [root for root in (_root_near_zero(fine), _root_near_zero(coarse)) if root is not None]
    return _Interpolation(beside, fine, roots) if len(roots) == 2 else None


def _parts() -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    return np.ones(_NODES.size, dtype=bool), np.abs(_NODES) < 1.0


def _fit(values: Array, part: NDArray[np.bool_]) -> Polynomial:
    return Polynomial.fit(_NODES[part], values[part], int(part.sum()) - 1)


def _root_near_zero(polynomial: Polynomial) -> float | None:
    roots = polynomial.roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    near = real[np.abs(real) < np.abs(_NODES).min()]
    return float(near[np.abs(near).argmin()]) if near.size else None
