"""Search for the points where a periodic orbit loses or gains stability as one parameter changes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import AnalysisError
from chilopod.flows.balance import numerical_balance
from chilopod.frozen import Array
from chilopod.stability.branches.fold import Fold
from chilopod.stability.crossing_points.description import Formed, described
from chilopod.stability.crossing_points.place import Course, past_singular, place_error
from chilopod.stability.normal_forms.normal_form import normal_form as normal_form_of
from chilopod.stability.orbit_blocks import crossings_in, orbit_blocks
from chilopod.stability.orbits.orbit import Orbit, bounded, from_known
from chilopod.stability.points import BifurcationPoint, Kind
from chilopod.stability.problem.arguments import check_arguments, checked_interval
from chilopod.stability.problem.budget import SpentError
from chilopod.stability.problem.capabilities import Family
from chilopod.stability.problem.returns import ReturnMap, returned_states
from chilopod.stability.problem.scales import sizes
from chilopod.stability.search.located import Found, Located, located
from chilopod.stability.search.samples import Samples
from chilopod.stability.shown import bounded as bounded_text
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.unit_circle.critical import Crossing
from chilopod.stability.unit_circle.crossings import BUDGET, Crossings, SearchStatus, find_crossings
from chilopod.stability.unit_circle.spectra import Event, Matrices

_DESCRIBING = 400  # budget of return maps for the orbits beside a point
_FOLLOWED = 10.0  # factor on the error of the first orbit for that of followed ones
_LEAST_ERROR = 1e-15
_BESIDE = 1e-6  # distance from a crossing at which rates of change are computed, relative to the interval


def locate(
    family: Family,
    between: tuple[float, float],
    orbit: ArrayLike | None = None,
    normal_form: bool = True,
    budget: int = BUDGET,
    seconds: float = math.inf,
) -> Located:
    """Find every bifurcation of a periodic orbit in an interval of a parameter.

    Spatial symmetries of the orbit split the return map into blocks, each of which is searched
    separately.

    Parameters
    ----------
    family
        ``family(value)`` is the system at a value of the parameter.
    between
        Interval ``low < high``.
        orbit
        Guess of a state on the orbit at time 0 for ``low``, shape (n,); the orbit is then followed through the
        interval. Not needed if the systems know their orbit.
    normal_form
        True to compute coefficients and verdicts as well.
    budget
        Number of orbits to follow the first one through the interval, and again for the search; twice as many return
        maps also end either, including those of Newton's method and of failed attempts. Separate limits hold for the
        first orbit, whose motion may settle, and for every point found: 400 return maps and its normal form.
    seconds
        Time, s, after which the search ends with its results so far. It includes the first orbit and running flows,
        but not compilation; the description of found points may take 0.7 s more.

    Returns
    -------
    Points by rising parameter, with the status of the search.

    Raises
    ------
    ParameterError
        If the interval is empty, reversed or not finite.
    AnalysisError
        If no orbit is found at the lower end of the interval, or ``family`` raises an exception there. At any other
        value an exception counts as a missing orbit and gives a remark.
    """
    low, high = checked_interval(between)
    check_arguments(family=family, normal_form=normal_form, budget=budget)
    samples = Samples(family, orbit, low, high, budget, seconds)
    return located(
        samples,
        lambda start, end: _crossings(samples, start, end, budget),
        lambda crossing, block: [_described(samples, crossing, block, normal_form)],
        lambda fold: _fold(samples, fold, normal_form),
        _DESCRIBING,
    )


def _crossings(samples: Samples, start: float, end: float, budget: int) -> list[tuple[Block | None, Crossings]]:
    """The crossings in every block of the return map."""
    try:
        blocks, remarks = orbit_blocks(samples.family(samples.low), samples.first)
        # The first orbit may contract strongly within a return, and followed ones less.
        uncertain = _FOLLOWED * _relative(samples.of_flow(), at_least=1.0)
    except SpentError as error:
        return [(None, Crossings((), SearchStatus.BUDGET, (error.problem,), 0))]

    def whole(values: Array) -> tuple[Array, Array]:
        found = samples.at(values)
        if samples.known:
            shape = found[0].image.jacobian.shape
            errors = np.stack([np.broadcast_to(each.image.error, shape) for each in found])
        elif blocks == (None,):
            errors = np.array([samples.error(each, uncertain) for each in found])
        else:  # a symmetry-breaking mode does not affect the orbit's accuracy
            errors = np.full(len(found), uncertain)
        return np.stack([each.image.jacobian for each in found]), errors

    def search(matrices: Matrices) -> Crossings:
        found = find_crossings(matrices, start, end, budget=budget, affordable=samples.affordable)
        return replace(found, remarks=(*remarks, *found.remarks))

    return [(block, crossings_in(block, whole, search)) for block in blocks]


def _touches(samples: Samples, crossing: Crossing) -> bool:
    """True if one multiplier, or one pair, touches the circle within the interval and goes back."""
    simple = crossing.multiplicity <= (2 if crossing.event is Event.PAIR else 1)
    return simple and crossing.change == 0 and not crossing.collision and samples.low < crossing.value < samples.high


def _described(samples: Samples, crossing: Crossing, block: Block | None, with_normal_form: bool) -> Found:
    """Description of a crossing of a known or followed orbit."""
    touch = _touches(samples, crossing)

    def bounded_at(value: float, state: Array, error: Array, image: ReturnMap) -> Orbit:
        return bounded(samples.family(value), state, image, error=error)

    course = Course(samples.at, samples.low, samples.end, samples.width, _BESIDE * samples.width)
    # A symmetry-breaking mode is not part of the orbit, which is regular among symmetric states.
    trivial = block is None or block.trivial
    regular = past_singular(course, crossing, bounded_at) if trivial and not samples.known else None
    if regular is None:
        value, orbit = crossing.value, _orbit(samples, crossing.value)
        bound = place_error(course, crossing, orbit.image)
    else:
        value, bound, orbit = regular.place, regular.error_bound, regular.orbit
    # Where an orbit is lost the point may be its fold.
    lost = samples.end < samples.high and value + bound >= samples.end
    kind = Kind.BRANCH_POINT if (touch or (lost and trivial)) and crossing.event is Event.PLUS else None
    system, formed, asked = samples.family(value), _formed(samples, value, orbit), with_normal_form and not touch
    point = described(system, (value, bound), orbit, crossing, block, formed, kind=kind, with_normal_form=asked)
    if not point.error_bound < samples.width:
        raise AnalysisError(f"its error bound of {point.error_bound:.1e} is too large", field="value")
    if touch:
        value_text = bounded_text(point.value, point.error_bound)
        return f"at {value_text} a multiplier only touches the unit circle and goes back: nothing changes"
    return point


def _fold(samples: Samples, fold: Fold, with_normal_form: bool) -> BifurcationPoint:
    """The fold that a followed orbit begins or ends in."""
    orbit = Orbit(fold.image.state, fold.image, np.zeros(fold.image.state.size))
    crossing = Crossing(fold.value, (fold.value, fold.value), Event.PLUS, 1, 1, 1.0 + 0.0j)
    system, place, formed = (
        samples.family(fold.value),
        (fold.value, fold.error_bound),
        _formed(samples, fold.value, orbit),
    )
    about: dict[str, Any] = {"kind": Kind.FOLD, "with_normal_form": with_normal_form}
    return described(system, place, orbit, crossing, None, formed, **about)


def _orbit(samples: Samples, value: float) -> Orbit:
    """The orbit at a value, with error bounds."""
    sample = samples.at(np.array([value]))[0]
    system = samples.family(value)
    return (
        from_known(system, sample.orbit, image=sample.image)
        if samples.known
        else bounded(system, sample.orbit, sample.image)
    )


def _formed(samples: Samples, value: float, orbit: Orbit) -> Formed:
    system = samples.family(value)
    scale = sizes(system, orbit.state, orbit.period / orbit.image.returns)

    def mapped(states: Array) -> Array:
        return returned_states(system, states, orbit.section)

    return lambda critical, uncertainty: normal_form_of(mapped, critical, uncertainty=uncertainty, scale=scale)


def _relative(image: ReturnMap, at_least: float = 0.0) -> float:
    """Error of the derivative, relative to its largest entry or a lower bound of that, in units that balance
    the states."""
    # An entry of round-off gives no information on the units.
    units = numerical_balance(np.abs(image.jacobian) + np.nan_to_num(image.error))
    largest = max(at_least, float(np.abs(image.jacobian * units / units[:, None]).max()))
    if not largest > 0.0:
        return _LEAST_ERROR
    return max(_LEAST_ERROR, float(np.max(image.error * units / units[:, None])) / largest)
