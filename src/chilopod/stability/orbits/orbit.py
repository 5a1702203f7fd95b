"""Periodic orbits: fixed points of the return map, by Newton's method.

``searched_orbit`` takes a guess, or the system's own state (``from_known``). ``near_orbit`` corrects it, by ``shot``
or, for a large system, without the derivative as a matrix. After a failure other guesses are tried. An orbit of several
rounds is cut down to one (``closings``). ``with_bounds`` bounds the errors.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import AnalysisError, ChilopodError
from chilopod.flows.arguments import check_arguments, finite_array
from chilopod.flows.carrying import REPEATED, TooManySteps
from chilopod.flows.deadline import Budget, Deadline
from chilopod.frozen import Array, ReadOnlyArrays, in_one_line
from chilopod.stability import returns
from chilopod.stability.interface import Capabilities, SystemLike, check_system, is_autonomous, is_stiff, offers, sizes
from chilopod.stability.krylov import LARGE, RESTS, TangentMap, closed_orbit, tangent_map, tangent_sizes
from chilopod.stability.orbits.guesses import nearer_orbits, own_return, past_impact, whole_orbit
from chilopod.stability.orbits.shooting import Nodes, Problem, nodes_along, shot
from chilopod.stability.returns import ReturnMap, Section
from chilopod.stability.shown import Shown
from chilopod.stability.symmetry.groups import symmetric_basis

_RETURNED = 1e-12  # relative residual of a known orbit that is exact
_MISSES = 1e-6  # error of a state, relative to its size, with which a return does not close
_SINGULAR = 1e-13  # singular value of H - 1, relative to the largest, that counts as zero
_FAR = 0.01  # distance of an orbit, relative to the states, beyond which the guess itself may be on another one
_KNOWN = 1e-4  # largest relative residual of a known orbit, which is then corrected
_SETTLING = 100  # cost of settling in return maps, without derivatives
_MOST_PARTS = 100  # ratio of the period found first to the shortest, below which that is found
_ROUNDS = 8  # number of rounds of an orbit in a return up to which it is tried as a whole, not its prime factors
_CLOSES = 1e-8  # residual, relative to motion and sizes of the states, of an early return that is then corrected
_COARSE = 1e-11  # error, relative to the sizes of the states, from which a second computation estimates it too
_CHANCE = 1e-13  # difference, relative to the sizes of the states, of two computations that may agree by chance
_BETWEEN = np.array([0.25, 0.251])  # times within a return
_SYMMETRIC = 1e-12  # residual, relative to the sizes of the states, of a symmetry of the orbit
_ALIKE = 1e-6  # distance of a return, relative to the sizes and its growth, from the symmetric one


@dataclass(frozen=True, eq=False)
class Orbit(Shown, ReadOnlyArrays):
    """A periodic orbit.

    Attributes
    ----------
    state
        State at time 0, shape (n,).
    image
        Return map at that state.
    error
        Bound on the error of ``state``, shape (n,); zero if it is exact, NaN if not computed.
    """

    state: Array
    image: ReturnMap
    error: Array

    @property
    def period(self) -> float:
        return self.image.period

    @property
    def section(self) -> Section | None:
        """Section of ``image``, if the system does not depend on time."""
        normal = self.image.normal
        return None if normal is None else Section(self.state, normal, self.image.duration)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        """The state, so that an orbit serves wherever a guess of one is wanted."""
        return np.array(self.state, dtype=dtype)

    def _lines(self) -> list[str]:
        return [
            f"Orbit: period {self.period:.10g}, {self.image.returns} return{'s' * (self.image.returns > 1)} in it",
            f"state at time 0: {in_one_line(self.state)}",
            f"bounds on its error: {in_one_line(self.error)}",
        ]


def known_state(system: SystemLike) -> Array:
    """The system's own state on its orbit; an AnalysisError if it has none."""
    orbit = getattr(system, "orbit", None)
    if orbit is None:
        said = "this system has no known periodic orbit"
        raise AnalysisError(said, field="orbit", allowed="a first guess of the orbit")
    return finite_array(orbit, (system.dimension,), "orbit")


def find_orbit(
    system: SystemLike,
    guess: ArrayLike | None = None,
    with_error: bool = True,
    settle: bool = True,
    *,
    seconds: float = math.inf,
) -> Orbit:
    """A periodic orbit: a fixed point of the return map, by Newton's method.

    For a system that does not depend on time the result has the shortest period, even if the guess is nearer to a
    multiple of it, below 100: if the motion closes earlier, the orbit is corrected again over that time. (An orbit of
    twice the period that branches off at a period doubling does not close earlier.)

    If Newton's method fails at the guess, it is tried from a state further along the motion, provided that every state
    may be time 0, and then after the motion has settled. A guess whose motion takes too many steps is refused.

    Parameters
    ----------
    system
        System; one that knows its orbit needs no guess.
    guess
        State at time 0 near the orbit, shape (n,), or an :class:`Orbit`; or a whole orbit near it, for multiple
        shooting: states at even times over one period, shape (times, n), or times and states, shapes (times,) and
        (times, n), as a tuple or an ``xarray.DataArray`` over ``time``, from any time on. The result then has the
        period of the guess.
    with_error
        True to bound errors.
    settle
        True to let the motion settle if Newton's method fails: up to 330 returns, or 83 guessed periods.
    seconds
        Time, s, after which the search ends with a SpentError; it ends with an AnalysisError if no start converges.
    """
    check_system(system)
    check_arguments(with_error=with_error, settle=settle)
    with Deadline(seconds):
        return searched_orbit(system, guess, with_error, settle=settle)


def searched_orbit(
    system: SystemLike,
    guess: ArrayLike | None,
    with_error: bool = True,
    section: Section | None = None,
    settle: bool = True,
    budget: Budget | None = None,
    shortest: bool = True,
) -> Orbit:
    """As :func:`find_orbit`, on a section if given, within a budget of return maps: up to 60 are taken for every start
    of Newton's method, and 100 for settling; without a section over the ``shortest`` period if wanted."""
    if guess is None:
        return from_known(system, known_state(system), with_error, budget=budget)
    whole = whole_orbit(guess, system)
    if whole is not None:
        return near_orbit(system, whole, with_error, budget)
    x = finite_array(guess, (system.dimension,), "orbit")
    period = guess.period if isinstance(guess, Orbit) and is_autonomous(system) else None
    duration = returns.return_duration(system, period) if section is None else section.duration

    def near(start: Nodes, section: Section | None = None, careful: bool = False) -> Orbit:
        found = near_orbit(system, start, with_error, budget, section, careful)
        return _shortest(system, found, with_error, budget) if shortened else found

    shortened = shortest and section is None
    try:
        x = past_impact(system, x, duration) if section is None else x
        found = near(Nodes(x[None], duration), section)
    except TooManySteps as error:
        allowed = ", ".join(filter(None, ("a guess closer to the orbit and its period", error.allowed)))
        raise TooManySteps(f"the motion from the guess {error.problem}", field="orbit", allowed=allowed) from error
    except AnalysisError as failed:
        if not settle:
            raise
        if budget is not None:
            budget.take(_SETTLING)
        own = ((nodes, False) for nodes in own_return(system, x)) if shortened else ()
        for nodes, careful in itertools.chain(own, nearer_orbits(system, x)):
            with contextlib.suppress(AnalysisError):
                return near(nodes, careful=careful)
        raise failed
    size = sizes(system, x, duration)
    if shortened and (off := _relative(found.state - x, size)) > _FAR:
        # The time may lead to another orbit although the state is on one.
        for nodes in own_return(system, x):
            with contextlib.suppress(AnalysisError):
                other = near(nodes)
                found = other if _relative(other.state - x, size) < off else found
    return found


def find_large_orbit(system: Capabilities, guess: ArrayLike | None = None) -> tuple[TangentMap, Array]:
    """As :func:`find_orbit`, for a large system: the return map on the orbit without its derivative as a matrix, and
    the sizes of the states, shape (n,). If that method fails, :func:`searched_orbit` takes over."""
    x = known_state(system) if guess is None else finite_array(guess, (system.dimension,), "orbit")
    exact = guess is None and not is_autonomous(system)
    try:
        image, size = closed_orbit(system, x, limit=_KNOWN if exact else np.inf)
    except AnalysisError:
        found = searched_orbit(system, guess, with_error=False)
        size = tangent_sizes(system, found.state, found.image.duration)
        return tangent_map(system, found.state, found.section), size
    with contextlib.suppress(AnalysisError):
        while (parts := closings(system, image.point, image.duration, size, _MOST_PARTS)) > 1:
            section = returns.section_at(system, image.point, size, image.duration / parts)
            image, size = closed_orbit(system, image.point, section)
    return image, size


def _shortest(system: SystemLike, orbit: Orbit, with_error: bool, budget: Budget | None) -> Orbit:
    """Orbit over its shortest period, if every instant may be time 0."""
    if not is_autonomous(system):
        return orbit
    duration = orbit.image.duration
    while (parts := closings(system, orbit.state, duration, sizes(system, orbit.state, duration), _MOST_PARTS)) > 1:
        duration /= parts
        try:
            orbit = near_orbit(system, Nodes(orbit.state[None], duration), with_error, budget)
        except AnalysisError:
            break
        duration = orbit.image.duration
    return orbit


def rounds_in(system: SystemLike, x: Array, duration: float, size: Array, expected: float) -> int:
    """Number of rounds of an orbit in a return: several may be found where the period falls fast. An AnalysisError if
    it is not much longer than ``expected``: orbits of twice the period may also end at such an orbit."""
    rounds = closings(system, x, duration, size)
    if rounds > 1 and duration <= math.sqrt(rounds) * expected:
        raise AnalysisError("the motion closes before the period is over", field="period")
    return rounds


def closings(system: SystemLike, x: Array, duration: float, size: Array, most: int = _ROUNDS) -> int:
    """Number of times, up to ``most``, that a return closes within its duration, or a factor of it, with the sizes of
    the states for the shorter time."""
    if not is_autonomous(system):
        return 1
    # Without a symmetry every multiple is a return, so that of many rounds closes after a prime factor of them too.
    few = _ROUNDS if system.symmetry is None else most
    counts = np.array([m for m in range(most, 1, -1) if m <= few or all(m % d for d in range(2, m))])
    states, passed = [x], 0.0
    for time in duration / counts:
        states.append(returns.carried(system, states[-1][None], 0.0, time - passed)[0])
        passed = time
    # Over several rounds a sixteenth of the time may be half a round, where a state is zero again.
    size = np.maximum(size, np.abs(states).max(axis=0))
    near = _CLOSES * min(1.0, _relative(returns.velocity_at(system, x) * duration, size))
    closed = counts[(np.abs(returns.turned(system, np.array(states[1:])) - x) / size).max(axis=1) <= near]
    return int(closed[0]) if closed.size else 1


def from_known(
    system: SystemLike, x: Array, with_error: bool = True, image: ReturnMap | None = None, budget: Budget | None = None
) -> Orbit:
    """The orbit through the system's own state, corrected if not exact; the return map there may be given."""
    if is_autonomous(system):
        return searched_orbit(system, x, with_error, budget=budget)
    image = returns.return_map(system, x, with_error) if image is None else image
    moved = np.abs(image.state - x)
    # No size is smaller than the state's value, unless the system gives the sizes.
    if not moved.any() or (not offers(system, "scale") and (moved <= _RETURNED * np.abs(x)).all()):
        return Orbit(x, image, np.zeros(x.size))
    size = sizes(system, x, image.duration)
    off = _relative(moved, size)
    if off <= _RETURNED * max(1.0, float(np.abs(image.jacobian * size / size[:, None]).max())):
        return Orbit(x, image, np.zeros(x.size))
    if off <= _KNOWN:
        return near_orbit(system, Nodes(x[None], returns.return_duration(system)), with_error, budget)
    said = f"must be a periodic orbit: one return moves the state by {float(moved.max()):.1e}"
    allowed = "a state on the orbit at time 0, or a first guess, which is then improved"
    raise AnalysisError(said, field="orbit", allowed=allowed)


def known_orbits(systems: Sequence[SystemLike], budget: Budget | None = None) -> Iterator[Orbit]:
    """The orbits of systems that know them; the return maps are computed together, and first, if possible."""
    states = [known_state(system) for system in systems]
    images = returns.return_maps(systems, states)
    known = zip(systems, states, images, strict=True)
    return (from_known(system, state, image=image, budget=budget) for system, state, image in known)


def near_orbit(
    system: SystemLike,
    start: Nodes,
    with_error: bool,
    budget: Budget | None,
    section: Section | None = None,
    careful: bool = False,
    units: Array | None = None,
) -> Orbit:
    """The orbit near some nodes, the first on the section: by default across the motion there. The section across the
    orbit is at right angles in ``units`` of the states, shape (n,), by default their sizes."""
    x, duration = start.states[0], start.duration
    size, end, closed = sizes(system, x, duration), None, None
    section = section or returns.section_at(system, x, size, duration)
    if system.dimension >= LARGE and offers(system, "flow_tangents") and len(start.states) == 1:
        with contextlib.suppress(AnalysisError):
            closed = closed_orbit(system, x, section, budget=budget)[0]
            x, duration, units = closed.point, closed.duration, None
    if closed is None:
        if len(start.states) > 1:  # all nodes give better sizes than the first one
            largest = np.abs(start.states).max(axis=0)
            size = np.where(largest > 0.0, largest, float(largest.max()) or 1.0)
        # In the space of the orbit's symmetries H - 1 is regular also where a symmetry-breaking mode is critical.
        basis = symmetric_basis(system, x, size, _SYMMETRIC)
        shared = None if basis is None else size[:, None] * basis
        if basis is not None:  # no correction would remove what is left of asymmetry
            start = start._replace(states=start.states / size @ basis @ basis.T * size)
        found = shot(Problem(lambda _: system, None, shared, budget, careful), start, size, section)
        x, duration, size, end = found.nodes.states[0], found.nodes.duration, found.sizes, (found.end, found.jacobian)
        # A state that only jumps, such as a mode, is free where no event happens: the corrector may put it anywhere.
        if is_autonomous(system):
            rests = (found.jacobian == np.eye(x.size)).all(axis=1) & (returns.velocity_at(system, x) == 0.0)
            free = rests & (np.abs(x - start.states[0]) > RESTS * size)
            later = nodes_along(system, start.states[0], 1.5 * duration, 4 if free.any() else 1).states
            if (later != start.states[0])[:, free].any():
                said = "no event happens on the orbit found"
                raise AnalysisError(said, field="orbit", allowed="a guess closer to it")
    if is_autonomous(system) and _relative(returns.velocity_at(system, x) * duration, size) <= RESTS:
        said = "the corrector found an equilibrium near the guess"
        raise AnalysisError(said, field="orbit", allowed="a guess closer to an orbit")
    if with_error:
        if system.symmetry is not None and not is_autonomous(system):
            _check_symmetry(system, x, duration, size, np.eye(x.size) if end is None else end[1])
        return with_bounds(system, x, duration)
    section = returns.section_at(system, x, units, duration)
    if end is None:
        image = returns.return_map(system, x, False, section)
    else:
        image = returns.on_section(system, section, *end, duration)
    return Orbit(x, image, np.full(x.size, np.nan))


def past_event(system: SystemLike, x: Array, duration: float, budget: Budget | None = None) -> Orbit | None:
    """The orbit through a state with another time 0 if an event passes that; else None."""
    with contextlib.suppress(ChilopodError):
        for there in returns.starts(system, x, duration):
            return near_orbit(system, Nodes(there[None], duration), False, budget)
    return None


def _check_symmetry(system: SystemLike, x: Array, duration: float, size: Array, jacobian: Array) -> None:
    """AnalysisError if the second return from an orbit's state is not symmetric to the first, with its derivative."""
    symmetry = np.asarray(system.symmetry)
    after: Array = np.linalg.solve(symmetry, x).astype(np.float64)
    off = _relative(symmetry @ returns.carried(system, after[None], duration, 2.0 * duration)[0] - after, size)
    if off > _ALIKE * max(1.0, float(np.abs(jacobian * size / size[:, None]).max())):
        said = f"must be one of the motion: after a return it misses the symmetric one by {off:.1e} of its size"
        allowed = "S with S f(t + T/k, x) = f(t, S x), of order k, also for guards and resets"
        raise AnalysisError(said, field="symmetry", allowed=allowed)


def with_bounds(system: SystemLike, x: Array, duration: float, error: Array | None = None) -> Orbit:
    """The orbit through a state on it, shape (n,), with the section across its motion and with error bounds, by the
    approximate ``duration`` of a return; ``error`` is a bound on the state's error, shape (n,), if known."""
    size = sizes(system, x, duration)
    shared, given = symmetric_basis(system, x, size, _SYMMETRIC), x
    basis = np.eye(x.size) if shared is None else shared
    x = size * (basis @ (basis.T @ (x / size))) if shared is not None else x
    section = returns.section_at(system, x, size, duration)
    image = returns.return_map(system, x, True, section)
    scaled = image.jacobian * size / size[:, None] - np.eye(x.size)
    if error is None:
        if _relative(image.state - x, size) > _MISSES * max(1.0, float(np.abs(scaled).max())):
            said = f"the motion misses itself by {_relative(image.state - x, size):.1e} of its size"
            raise AnalysisError(said, field="orbit", allowed="a guess closer to an orbit and its period")
        # The state's error is that of the flow, from the derivative's error or, where that is coarse, from two
        # computations, multiplied by the inverse of H - 1.
        flow = (image.error if isinstance(image.error, np.ndarray) else np.full(scaled.shape, image.error)) @ size
        stiff = is_stiff(system, x, duration)  # the derivative and its error may vanish
        if stiff or (flow > _COARSE * size).any():
            twice = REPEATED * np.abs(returns.in_parts(system, x, image.duration) - image.state) + _CHANCE * size
            flow = flow + twice if stiff else np.minimum(flow, twice)
        wrong = np.abs(image.state - x) + flow
        # Terms of a map, which does not move between whole times, may cancel.
        if not offers(system, "velocity") and (returns.carried(system, x[None], *_BETWEEN * duration)[0] == x).all():
            wrong += returns.scatter(system, image, x, size, section)
        left, singular, right = np.linalg.svd(basis.T @ scaled @ basis)
        least = _SINGULAR * singular.max(initial=1.0)
        # Autonomous orbits may be a family, of which any is right; others that are free are not known at all.
        cut = (singular <= least) & is_autonomous(system)
        inverse = basis @ (right.T * np.where(cut, 0.0, 1.0 / np.maximum(singular, least))) @ left.T @ basis.T
        error = size * (np.abs(inverse) @ (wrong / size)) + np.abs(x - given)
    # The derivative belongs to a state with this error: along the orbit's least certain direction.
    weakest = size * np.linalg.svd(scaled)[2][-1]
    beside = returns.return_map(system, x + returns.BESIDE * weakest, with_error=False, section=section)
    bend = np.abs(beside.jacobian - image.jacobian) * (_relative(error, size) / returns.BESIDE)
    return Orbit(x, replace(image, error=image.error + bend), error)


def _relative(values: Array, size: Array) -> float:
    return float((np.abs(values) / size).max())
