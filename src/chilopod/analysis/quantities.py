"""Numbers that describe how a robot walks straight and bends, as functions of its description.

The leading :class:`Mode` of the straight walk comes from its return map. An :class:`Onset` is the number whose change
bends the robot; it finds the critical value in an interval, or beside that of a similar robot; :class:`Leading` has its
derivatives. :class:`Measured` has a method for each of :data:`QUANTITIES`, and bounds on their errors. It keeps the
last onset and the last curved walk, from which those of similar robots are corrected in a fraction of the time of a
search or a branch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from scipy.linalg import eig

from chilopod import units
from chilopod.analysis.branch import curved_walks
from chilopod.analysis.derivatives import ROUND_OFF, derivative
from chilopod.analysis.growth import FATES, Fate, growing
from chilopod.analysis.parameters import ALL, K1, searched_springs
from chilopod.analysis.straight_walk import WalkBifurcation, bifurcations, first_loss, interval_text
from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import Array, ComplexArray
from chilopod.planar import PlanarModel
from chilopod.planar.along import WalkMeans, walk_means
from chilopod.planar.stretch import MOST_BENT
from chilopod.robot import Robot
from chilopod.robot.parameters import place_of
from chilopod.stability import find_orbit, multipliers
from chilopod.stability.returns import ReturnMap, return_map

_ROUNDS = 12  # of the secant method for a critical value
_SETTLED = 1e-11  # relative change at which it ends
_APART = 0.3  # relative change within which a critical value is looked for beside a known one
_ALIKE = 1e-9  # relative difference of the moduli of a pair
_BESIDE = 1e-3  # relative distance of its second value
_CORRECTIONS = 20  # of a neighbouring curved walk
_CORRECTED = 1e-12  # last correction of its state, SI
_ROUNDING = 1e-6  # last one relative to the bend, at most, where rounding leaves more than that beside the onset
_BENT = 1e-6  # least sum of its joint angles, rad

QUANTITIES = {
    "onset": "", "growth": "1/s", "frequency": "rad/s", "coefficient": "1/rad^2", "radius": "m", "speed": "m/s",
    "settling": "s", "margin": "", "friction": "", "work": "J",
}  # fmt: skip
"""Units by the name of the quantity, a method of :class:`Measured`; that of the onset is that of its number."""

TOO_BENT = "the curved walk bends a joint by more than a right angle"

UNEVEN = "gait.side_phase"
"""Number whose other values end the symmetry of half a period."""

_OF_WALKS = {"radius", "speed", "settling", "work"}  # curved ones


class Mode(NamedTuple):
    """Leading mode of the straight walk: the multiplier of largest modulus, its left and right eigenvectors with a
    product of 1, shape (2N+1,), the duration of the return map, s, and the number of returns in a period."""

    multiplier: complex
    left: ComplexArray
    right: ComplexArray
    duration: float
    returns: int

    @property
    def growth(self) -> float:
        """Growth rate, 1/s."""
        return float(np.log(abs(self.multiplier))) / self.duration

    @property
    def frequency(self) -> float:
        """Frequency, rad/s; 0 for a real multiplier of half a period."""
        turns = abs(np.angle(self.multiplier**self.returns))
        return float(turns) / (self.returns * self.duration)

    @property
    def fate(self) -> Fate:
        """Fate of the disturbance where it grows."""
        return FATES[int(growing(np.array(self.multiplier), self.returns == 2))]


def straight_return(robot: Robot, symmetric: bool = True) -> ReturnMap:
    """Return map of the straight walk, over half a period where the gait has that symmetry."""
    model = PlanarModel(robot, use_symmetry=symmetric)
    return return_map(model, model.orbit, with_error=False)


def leading_mode(robot: Robot, symmetric: bool = True) -> Mode:
    """The leading mode of the straight walk; of a pair, that which turns forward over the whole period."""
    image = straight_return(robot, symmetric)
    values, left, right = eig(image.jacobian, left=True)
    first = np.abs(values) >= np.abs(values).max() * (1.0 - _ALIKE)
    at = int(np.where(first, (values**image.returns).imag, -np.inf).argmax())
    bra, ket = left[:, at].conj(), right[:, at]
    return Mode(complex(values[at]), bra / (bra @ ket), ket, image.duration, image.returns)


@dataclass(frozen=True)
class Onset:
    """The number at whose critical value the straight walk loses stability, to a bend or an undulation, the interval in
    which that is searched, of springs by default that of :func:`chilopod.analysis.parameters.searched_springs`, and the
    value at which straight and curved walks are studied, by default that of each robot; SI. Most robots bend as a
    spring falls. Where the straight walk is unstable at the upper end of the interval and stable at the lower one, the
    robot bends as the number rises."""

    parameter: str = K1
    between: tuple[float, float] | None = None
    at: float | None = None

    def __post_init__(self) -> None:
        if self.between is None:
            if not self.parameter.startswith(ALL):
                raise ParameterError(f"must be given for {self.parameter}", field="between")
        elif not (np.isfinite(self.between).all() and self.between[0] < self.between[1]):
            raise ParameterError("must rise and be finite", field="between", value=self.between)

    def interval(self, robot: Robot) -> tuple[float, float]:
        """Interval of the search for a robot, SI."""
        return self.between or searched_springs(robot)

    def there(self, robot: Robot) -> Robot:
        """The robot at the value at which walks are studied."""
        return robot if self.at is None else robot.with_value(self.parameter, self.at)

    def first(self, robot: Robot, normal_form: bool = False) -> WalkBifurcation:
        """Bifurcation at which the straight walk loses stability as the number changes; AnalysisError if there is none,
        or the walk is unstable at both ends of the interval."""
        between = self.interval(robot)
        if not self.rises(robot):
            return first_loss(robot, self.parameter, between, None, normal_form)
        if leading_mode(robot.with_value(self.parameter, between[0])).growth > 0.0:
            said = interval_text(robot, self.parameter, between)
            raise AnalysisError("the straight walk is unstable at both ends", field=self.parameter, value=said)
        return bifurcations(robot, self.parameter, between, normal_form)[0]

    def beside(self, robot: Robot, value: float) -> float:
        """Critical value in the interval near that of a similar robot, where the largest modulus of a multiplier is 1,
        by the secant method; by :meth:`first` where that fails."""
        k, other = value, value * (1.0 + _BESIDE)
        growth, others = (leading_mode(robot.with_value(self.parameter, each)).growth for each in (k, other))
        for _ in range(_ROUNDS):
            step = growth * (k - other) / (growth - others) if growth != others else np.nan
            k, other, others = k - step, k, growth
            if not abs(k - value) <= _APART * abs(value):
                break
            if abs(step) <= _SETTLED * abs(k):
                low, high = self.interval(robot)
                return float(k) if low <= k <= high else self.first(robot).point.value
            growth = leading_mode(robot.with_value(self.parameter, k)).growth
        return self.first(robot).point.value

    def fate(self, robot: Robot, value: float) -> Fate:
        """Fate of a disturbance beyond a critical value: the straight walk bends or undulates."""
        return leading_mode(robot.with_value(self.parameter, value)).fate

    def in_words(self, robot: Robot, quantity: str, value: float, digits: int) -> str:
        """A quantity with its unit; for an onset, what the straight walk does beyond it."""
        if not np.isfinite(value):
            return "none"
        shown = units.format(value, unit_of(quantity, robot, self), digits=digits)
        return f"{shown} ({self.fate(robot, value).label})" if quantity == "onset" else shown

    def rises(self, robot: Robot) -> bool:
        """True if the straight walk is unstable at the upper end of the interval."""
        return leading_mode(robot.with_value(self.parameter, self.interval(robot)[1])).growth > 0.0


def size_of(robot: Robot, path: str) -> float:
    """Size of a number for steps, SI: its own, or a typical one if it is zero."""
    damping = max(robot.springs.stiffness) * robot.gait.period
    typical = {"springs.damping": damping, "legs.forward_offset": robot.module_length}
    return abs(robot.get(path)) or typical.get(path.partition("[")[0], 1.0)


class Leading:
    """Leading mode of a robot, and derivatives of its exponent."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.mode = cache(partial(leading_mode, robot))
        self.slope = cache(self._slope)

    def _slope(self, path: str, symmetric: bool) -> tuple[complex, float]:
        """Derivative of the exponent of the leading mode by a number, and its error; see :func:`leading_mode`."""
        mode: Mode = self.mode(symmetric)
        own = self._robot.get(path)

        def projected(value: float) -> Array:
            if value == own:
                return np.array([1.0, 0.0, mode.duration])
            image = straight_return(self._robot.with_value(path, value), mode.returns == 2)
            product = mode.left @ image.jacobian @ mode.right / mode.multiplier
            return np.array([product.real, product.imag, image.duration])

        (real, imaginary, longer), errors = derivative(projected, own, size_of(self._robot, path))
        exponent = complex(mode.growth, mode.frequency)
        slope = (complex(real, imaginary) - exponent * longer) / mode.duration
        return slope, float(np.hypot(errors[0], errors[1]) + abs(exponent) * errors[2]) / mode.duration

    def onset(self, number: str, path: str) -> tuple[float, float]:
        """Derivative of the critical value of a number, at which the robot is, by another number, and its error."""
        if number in (path, path.partition("[")[0]):
            return 0.0, 0.0  # it is replaced
        symmetric = UNEVEN not in (number, path)
        (by_onset, uncertain), (by_path, off) = self.slope(number, symmetric), self.slope(path, symmetric)
        found = -by_path.real / by_onset.real
        return found, (off + abs(found) * uncertain) / abs(by_onset.real)


class Measured:
    """Quantities of similar robots, SI: their onsets and curved walks are corrected from those of the robot before, but
    onsets are searched in the whole interval if not ``similar``. Each of :data:`QUANTITIES` is a method of a robot, and
    raises AnalysisError where the robot has no such quantity. ``number`` is that which bends the robots, ``branches``
    counts those that were followed so far, which take a second or more each, and ``near`` is the state of the curved
    walk from which the next is corrected, and the inverse of the slope of what it lacks."""

    def __init__(self, number: Onset, similar: bool = True, following: Callable[[], None] = lambda: None) -> None:
        """The number, whether robots are similar, and a function that is called before a branch is followed."""
        self.number, self.branches, self._similar, self._following = number, 0, similar, following
        self._critical: float | None = None
        self.near: tuple[Array, Array] | None = None
        self._last: tuple[Robot, WalkMeans] | None = None

    def function(self, name: str) -> Callable[[Robot], float]:
        """A quantity as a function of a robot, at the value of the number at which walks are studied."""
        return lambda robot: self.walked(name, self.number.there(robot))

    def walked(self, name: str, robot: Robot) -> float:
        """A quantity of a robot; AnalysisError also where it is one of a curved walk at which engines end."""
        value = float(getattr(self, name)(robot))
        if name in _OF_WALKS and self.growth(robot) > 0.0 and self.most_bent(robot) > MOST_BENT:
            raise AnalysisError(TOO_BENT, **self._place(robot))
        return value

    def error(self, name: str, robot: Robot) -> float:
        """Bound on the error of a quantity, from those of multipliers, orbits and onsets; of others by rounding."""
        value, curved = float(getattr(self, name)(robot)), name in _OF_WALKS and self.growth(robot) > 0.0
        error, model = ROUND_OFF * abs(value), PlanarModel(robot, use_symmetry=not curved)
        if curved:
            state, joints = self.state(robot), slice(3, model.modules + 2)
            orbit = find_orbit(model, state)
            off = (orbit.error + np.abs(orbit.state - state))[joints].sum() / np.abs(state[joints]).sum()
            error += 2.0 * float(off) * abs(value)  # squares of the angles enter, at most
        if name in ("growth", "frequency", "settling"):
            found = multipliers(model, state if curved else None)
            rate = float(found.error_bounds[0] / np.abs(found.values[0])) / model.period
            error += rate * (value**2 if name == "settling" else 1.0)
        elif name == "friction":
            error += self._by_friction(robot)[1]
        elif name in ("onset", "margin", "coefficient") or (name == "work" and curved):
            point = self.number.first(robot, normal_form=name == "coefficient").point
            own = robot.get(self.number.parameter)
            by_onset = {"onset": 1.0, "margin": own / point.value**2, "work": value / (point.value - own)}
            error += abs(by_onset.get(name, 0.0)) * point.error_bound
            if name == "coefficient":
                own_error = np.nan if point.coefficient_error is None else point.coefficient_error
                error += own_error * abs(value / (point.coefficient or 1.0))
        return error

    def onset(self, robot: Robot) -> float:
        """Critical value of the number."""
        known = self._critical if self._similar else None
        self._critical = self.number.first(robot).point.value if known is None else self.number.beside(robot, known)
        return self._critical

    def coefficient(self, robot: Robot) -> float:
        """Cubic coefficient of the normal form at the onset, 1/rad^2."""
        found = self.number.first(robot, normal_form=True)
        if found.coefficient is None:
            there = robot.with_value(self.number.parameter, found.point.value)
            said = f"the onset has no cubic coefficient: its kind is {found.point.kind.label}"
            raise AnalysisError(said, **self._place(there))
        return found.coefficient

    def growth(self, robot: Robot) -> float:
        """Growth rate of the leading mode of the straight walk, 1/s."""
        return leading_mode(robot).growth

    def frequency(self, robot: Robot) -> float:
        """Frequency of that mode, rad/s."""
        return leading_mode(robot).frequency

    def radius(self, robot: Robot) -> float:
        """Radius of the arc of the body on the curved walk, m, by the paper's measure."""
        return float(robot.axis_radius(self._means(robot).mean_angle[0]))

    def most_bent(self, robot: Robot) -> float:
        """Largest angle of any joint within a period of the curved walk, rad."""
        return float(self._means(robot).most_bent[0])

    def speed(self, robot: Robot) -> float:
        """Speed along the curved walk, or along the straight one if that is stable, m/s."""
        return self._means(robot).drifts[0].speed if self.growth(robot) > 0.0 else robot.gait.speed

    def settling(self, robot: Robot) -> float:
        """Time in which a small disturbance of that walk falls to 1/e, s."""
        growth = self.growth(robot)
        if growth > 0.0:
            model, state = PlanarModel(robot, use_symmetry=False), self.state(robot)
            largest = np.abs(np.linalg.eigvals(model.flow(state, 0.0, model.period)[1])).max()
            growth = float(np.log(largest)) / model.period
        if growth >= 0.0:
            raise AnalysisError("the walk does not settle", field="settling")
        return -1.0 / growth

    def margin(self, robot: Robot) -> float:
        """Relative distance of the robot's number from the onset, negative if the straight walk is unstable."""
        apart = robot.get(self.number.parameter) / self.onset(robot) - 1.0
        return -apart if self.number.rises(robot) else apart

    def friction(self, robot: Robot) -> float:
        """Relative change of the onset by a relative change of the friction of the floor."""
        return self._by_friction(robot)[0]

    def _by_friction(self, robot: Robot) -> tuple[float, float]:
        value, path = self.onset(robot), "ground.friction"
        found = Leading(robot.with_value(self.number.parameter, value)).onset(self.number.parameter, path)
        slope, error = (each * robot.get(path) / value for each in found)
        return slope, abs(error)

    def work(self, robot: Robot) -> float:
        """Work of an actuator that stiffens the curved walk's spring to the onset, at mean angles, J; 0 if straight."""
        if not self.number.parameter.startswith(ALL):
            raise AnalysisError("must be a spring that bends the robot", field="work", value=self.number.parameter)
        if self.growth(robot) <= 0.0:
            return 0.0
        joints = place_of(self.number.parameter).joints(robot.body.modules - 1)
        angles = self._means(robot).mean_angle[0][joints]
        return 0.5 * (self.onset(robot) - robot.get(self.number.parameter)) * float(angles @ angles)

    def state(self, robot: Robot) -> Array:
        """State at time 0 of the curved walk that leaves the straight one at the onset, shape (2N+1,); AnalysisError if
        the robot walks straight, or the branch does not reach it."""
        if self.growth(robot) <= 0.0:
            allowed = "one at which it is unstable; `chilopod branch` finds curved walks beside a stable straight one"
            raise AnalysisError("the straight walk is stable there", **self._place(robot), allowed=allowed)
        model = PlanarModel(robot, use_symmetry=False)
        found = None if self.near is None else _corrected(model, *self.near)
        if found is None:
            state = self._followed(robot, model)
            slope = model.flow(state, 0.0, model.period)[1] - np.eye(state.size)
            found = state, np.asarray(np.linalg.inv(slope), dtype=np.float64)
        self.near = found
        return found[0]

    def _place(self, robot: Robot) -> dict[str, str]:
        """Path of the number and its value, for an error."""
        path = self.number.parameter
        return {"field": path, "value": units.format(robot.get(path), robot.unit_of(path), digits=4)}

    def _means(self, robot: Robot) -> WalkMeans:
        if self._last is None or self._last[0] != robot:
            self._last = robot, walk_means([PlanarModel(robot)], self.state(robot)[None])
        return self._last[1]

    def _followed(self, robot: Robot, model: PlanarModel) -> Array:
        """State of the curved walk from its branch."""
        self._following()
        self.branches += 1
        path, (low, high) = self.number.parameter, self.number.interval(robot)
        at = robot.get(path)
        try:
            walks = curved_walks(robot, path, (low, at) if self.number.rises(robot) else (at, high))
        except AnalysisError as error:
            if str(error.field).startswith("between"):  # an interval that nobody gave
                error.field, error.allowed = path, "a number that bends this robot by a pitchfork"
            raise
        if float(walks.parameter_si[-1]) != at:
            raise AnalysisError(f"has no curved walk there: the branch ends, {walks.attrs['ending']}", field=path)
        state = np.asarray(find_orbit(model, walks.orbit.values[-1]).state)
        if not abs(float(state[3 : model.modules + 2].sum())) > _BENT:
            raise AnalysisError("the curved walk is too near the straight one to be told from it", field=path)
        return state


def _corrected(model: PlanarModel, state: Array, inverse: Array) -> tuple[Array, Array] | None:
    """State of the curved walk near that of a similar robot, by Broyden's method, and the inverse there; None if that
    fails, or ends at the straight walk or the mirror image."""
    if state.size != model.dimension:
        return None
    joints = slice(3, model.modules + 2)
    side = np.sign(state[joints].sum())
    with np.errstate(all="ignore"):
        try:
            left = model.flow_states(state[None], 0.0, model.period)[0] - state
            for _ in range(_CORRECTIONS):
                step = -inverse @ left
                state, before = state + step, left
                size, bend = float(np.abs(step).max()), float(side * state[joints].sum())
                if size <= _CORRECTED:
                    break
                left = model.flow_states(state[None], 0.0, model.period)[0] - state
                change = inverse @ (left - before)
                inverse = inverse + np.outer(step - change, step @ inverse) / (step @ change)
        except AnalysisError:
            return None
    return (state, inverse) if bend > _BENT and size <= max(_CORRECTED, _ROUNDING * bend) else None


def unit_of(quantity: str, robot: Robot, onset: Onset) -> str:
    """Unit in which a quantity is shown."""
    return robot.unit_of(onset.parameter) if quantity == "onset" else QUANTITIES[quantity]
