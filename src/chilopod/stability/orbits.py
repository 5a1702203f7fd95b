"""Periodic orbits: fixed points of the return map, by Newton's method."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import AnalysisError
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.arguments import finite_array
from chilopod.stability.capabilities import (
    Autonomous,
    FlowsTangents,
    SystemLike,
    is_autonomous,
    known_orbit,
    returns_per_period,
)
from chilopod.stability.krylov.closing import LARGE, closed_orbit
from chilopod.stability.krylov.tangent_map import TangentMap, tangent_map, tangent_sizes
from chilopod.stability.returns import (
    ReturnMap,
    Section,
    return_duration,
    return_map,
    returned_states,
    section_at,
    whole_period,
)
from chilopod.stability.scales import sizes

Array = NDArray[np.float64]

_ROUNDS = 30
_ROUND_OFF = 4e-16
_NOTHING = 1e-13  # of the sizes of the states around a guess: a state that small may be zero
_SETTLED = 1e-10  # residual, of the sizes of the states, below which it may stop falling
_RESTS = 1e-8  # of the sizes at the guess: a motion that short is none
_RETURNED = 1e-12  # of a known orbit: it is exact
_SINGULAR, _FAMILY = 1e-13, 1e-8  # singular values of H - 1 that count as zero, the largest being one
_MAGNIFIED = 1e9  # move over residual beyond which H - 1 may be singular
_KNOWN = 1e-4  # of a known orbit: it is one, if not to the last digit
_SHOTS, _LONGEST_SHOT = 20, 4.0  # rounds, and guessed periods
_FARTHEST_MOVE = 0.3  # of the sizes, and of how far the motion would go at its speed, in a move of Newton's method
_FARTHEST_STRETCH = 0.3  # likewise of the period
_CLOSED = 1e-6  # of the same: a motion that about closes
_ONWARD = 0.382  # of the guessed return, where a guess is of no use
_LONGEST_SETTLING = 300  # returns
_BESIDE = 1e-6  # of the sizes of the states, where the derivative is taken once more to see it change
_MARCHED, _MARCHES = 48, 8  # steps a guessed period, and guessed periods, in which a motion is to come back
_COMES_BACK = 0.1  # of its size
_STILL = 1e-3  # of how much the others move


@dataclass(frozen=True)
class Orbit(ReadOnlyArrays):
    """A periodic orbit.

    Attributes
    ----------
    state
        At time 0, shape (n,).
    image
        The return map there.
    error
        How far ``state`` may be off, shape (n,); zero where it is known exactly, NaN if it was not asked for.
    """

    state: Array
    image: ReturnMap
    error: Array

    @property
    def period(self) -> float:
        """The full period."""
        return self.image.period

    @property
    def section(self) -> Section | None:
        """The section that ``image`` returns to, where the system does not depend on time."""
        if self.image.normal is None:
            return None
        return Section(self.state, self.image.normal, self.image.period / self.image.returns)


def known_state(system: SystemLike) -> Array:
    """The state on its orbit that a system knows of itself.

    Raises
    ------
    AnalysisError
        If it knows none.
    """
    orbit = known_orbit(system)
    if orbit is None:
        raise AnalysisError(
            "this system does not know its periodic orbit", field="orbit", allowed="a first guess of it"
        )
    return np.asarray(orbit, dtype=np.float64)


def find_orbit(
    system: SystemLike,
    guess: ArrayLike | None = None,
    with_error: bool = True,
    section: Section | None = None,
    settle: bool = True,
) -> Orbit:
    """A periodic orbit: a fixed point of the return map, by Newton's method.

    Where it does not converge from the guess, it is tried from a state further along the motion if every state may be
    time 0, and then the motion is given time to settle on an orbit that attracts it.

    Parameters
    ----------
    system
        The system; one that knows its orbit needs no guess.
    guess
        A state at time 0 near the orbit, shape (n,).
    with_error
        Whether to bound errors.
    section
        Of a system that does not depend on time: where its orbit is looked for. By default across the motion in the
        guess; the orbit that is found has the section across its own motion.
    settle
        Whether to let the motion settle where Newton's method fails.

    Raises
    ------
    AnalysisError
        If neither helps.
    """
    if guess is None:
        return from_known(system, known_state(system), with_error)
    x = finite_array(guess, (system.dimension,), "orbit")
    try:
        return _newton(system, x, with_error, section)
    except AnalysisError as failed:
        if not settle:
            raise
        for nearer, after in _nearer(system, x):
            try:
                return _newton(system, nearer, with_error, after)
            except AnalysisError:
                continue
        raise failed


def find_large_orbit(system: FlowsTangents, guess: ArrayLike | None = None) -> tuple[TangentMap, Array]:
    """As :func:`find_orbit`, of a large system: the return map on the orbit without its derivative as a matrix, and the
    sizes of the states, shape (n,). Where the method for these fails, :func:`find_orbit` is asked."""
    x = known_state(system) if guess is None else finite_array(guess, (system.dimension,), "orbit")
    exact = guess is None and not is_autonomous(system)
    try:
        return closed_orbit(system, x, farthest=_KNOWN if exact else np.inf)
    except AnalysisError:
        found = find_orbit(system, guess, with_error=False)
        size = tangent_sizes(system, found.state, found.period / found.image.returns)
        return tangent_map(system, found.state, found.section), size


def from_known(system: SystemLike, x: Array, with_error: bool = True, image: ReturnMap | None = None) -> Orbit:
    """The orbit through a state that is on it, by what the system says of itself; improved if not to the last digit.

    Parameters
    ----------
    system, x, with_error
        As for :func:`find_orbit`.
    image
        The return map at ``x``, if it was computed already.
    """
    if is_autonomous(system):
        return find_orbit(system, x, with_error)
    image = return_map(system, x, with_error) if image is None else image
    moved = np.abs(image.state - x)
    if not moved.any():
        return Orbit(x, image, np.zeros(x.size))
    size = sizes(system, x, image.period / image.returns)
    off = _relative(moved, size)
    if off <= _RETURNED * max(1.0, float(np.abs(image.jacobian * size / size[:, None]).max())):
        return Orbit(x, image, np.zeros(x.size))
    if off <= _KNOWN:
        return _newton(system, x, with_error, None)
    raise AnalysisError(
        f"is no periodic orbit: one return later the state is {float(moved.max()):.1e} away",
        field="orbit",
        allowed="a state on the orbit at time 0, or as a first guess, which is then improved",
    )


def _relative(values: Array, size: Array) -> float:
    return float((np.abs(values) / size).max())


def _newton(system: SystemLike, x: Array, with_error: bool, section: Section | None) -> Orbit:
    size = sizes(system, x, return_duration(system) if section is None else section.duration)
    section = section_at(system, x, size) if section is None else section
    best = np.inf
    if system.dimension >= LARGE and isinstance(system, FlowsTangents):
        with contextlib.suppress(AnalysisError):
            x = closed_orbit(system, x, section)[0].point
            best = 0.0  # nothing is left to improve
    before, cutoff = x, _SINGULAR
    for rounds in range(_ROUNDS):
        image = return_map(system, x, with_error=False, section=section)
        size = np.maximum(size, np.maximum(np.abs(x), np.abs(image.state)) if x.any() else 0.0)
        residual = image.state - x
        off = _relative(residual, size)
        if off <= _ROUND_OFF or (off <= _SETTLED and off >= 0.5 * best):
            if image.velocity is not None and _relative(image.velocity * image.period / image.returns, size) <= _RESTS:
                raise AnalysisError(
                    "the motion rests in an equilibrium near the guess",
                    field="orbit",
                    allowed="a guess closer to an orbit",
                )
            x, image = _cleared(system, x, image, size, section)
            return _found(system, x, image, with_error)
        if rounds > 4 and off > 10.0 * best:
            break
        if off > best and best < _SETTLED and cutoff == _SINGULAR:
            # The last move followed round-off, along a family of orbits: without that direction it converges.
            x, cutoff, best = before, _FAMILY, np.inf
            continue
        best, before = min(best, off), x
        x = x - _solved(image.jacobian - np.eye(x.size), residual, size, cutoff)
        if not np.isfinite(x).all():
            break
        if section is not None:
            section = replace(section, duration=image.period / image.returns)
    raise AnalysisError(
        f"no periodic orbit found near the guess (it misses itself by {best:.1e} of its size)",
        field="orbit",
        allowed="a guess closer to the orbit",
    )


def _cleared(
    system: SystemLike, x: Array, image: ReturnMap, size: Array, section: Section | None
) -> tuple[Array, ReturnMap]:
    """An orbit with the states that are only just not zero at zero, if it is an orbit still: what is left of a guess
    would pass for the size of the orbit."""
    small = (x != 0.0) & (np.abs(x) <= _NOTHING * size)
    if not small.any():
        return x, image
    cleared = np.where(small, 0.0, x)
    there = return_map(system, cleared, with_error=False, section=section)
    off = _relative(there.state - cleared, size)
    return (cleared, there) if off <= max(_ROUND_OFF, _relative(image.state - x, size)) else (x, image)


def _solved(matrix: Array, right: Array, size: Array, cutoff: float) -> Array:
    """Solution of a linear system in units of the states' sizes; the shortest where orbits come in families."""
    scaled, right = matrix * size / size[:, None], right / size
    if cutoff == _SINGULAR:
        with contextlib.suppress(np.linalg.LinAlgError):
            regular = np.linalg.solve(scaled, right)
            if np.abs(regular).max() <= _MAGNIFIED * np.abs(right).max():
                return np.asarray(regular * size)
    return np.asarray(np.linalg.lstsq(scaled, right, rcond=cutoff)[0] * size)


def _found(system: SystemLike, x: Array, image: ReturnMap, with_error: bool) -> Orbit:
    if with_error:
        return bounded(system, x, image)
    if is_autonomous(system):
        image = return_map(system, x, False, _across(system, x, image))
    return Orbit(x, image, np.full(x.size, np.nan))


def _across(system: SystemLike, x: Array, image: ReturnMap) -> Section | None:
    duration = image.period / image.returns
    return section_at(system, x, sizes(system, x, duration), duration) if is_autonomous(system) else None


def bounded(system: SystemLike, x: Array, image: ReturnMap, error: Array | None = None) -> Orbit:
    """The orbit through a state that is on it, with the section across its own motion and with error bounds.

    Parameters
    ----------
    system, x
        The system and the state, shape (n,).
    image
        The return map there, or near.
    error
        How far off the state may be, shape (n,), if that is known.
    """
    size = sizes(system, x, image.period / image.returns)
    section = _across(system, x, image)
    image = return_map(system, x, True, section)
    scaled = image.jacobian * size / size[:, None] - np.eye(x.size)
    if error is None:
        # The state is as uncertain as the flow, of which the derivative's error tells, times what H - 1 makes of it.
        wrong = np.abs(image.state - x) + (_matrix(image.error, size) @ size)
        error = size * (np.abs(np.linalg.pinv(scaled, rcond=_SINGULAR)) @ (wrong / size))
    # The derivative is that of a state so far off: along the direction in which the orbit is least sure.
    weakest = size * np.linalg.svd(scaled)[2][-1]
    beside = return_map(system, x + _BESIDE * weakest, with_error=False, section=section)
    bend = np.abs(beside.jacobian - image.jacobian) * (_relative(error, size) / _BESIDE)
    return Orbit(x, replace(image, error=_matrix(image.error, size) + bend), error)


def _matrix(error: float | Array, size: Array) -> Array:
    """The error of every entry of a derivative."""
    return error if isinstance(error, np.ndarray) else np.full((size.size, size.size), error)


def _nearer(system: SystemLike, x: Array) -> Iterator[tuple[Array, Section | None]]:
    """States nearer to an orbit than a guess, with sections across the motion."""
    if is_autonomous(system):
        shot = _shot(system, x)
        if shot is not None:
            yield shot
    yield from _onward(system, x)
    yield from _settled(system, x)


def _shot(system: Autonomous, x: Array) -> tuple[Array, Section | None] | None:
    """A state and a period at which the motion about closes, by Newton's method for both together, each move at right
    angles to the motion (Seydel, *Practical Bifurcation and Stability Analysis*, 2010, section 7.1).

    Unlike a return to a section it needs no motion that comes back from the guess: of an orbit with a strongly stable
    direction only guesses on its stable manifold do.
    """
    count = returns_per_period(system)
    turn = np.eye(x.size) if system.symmetry is None else system.symmetry
    duration = system.guess_period / count
    longest, best = _LONGEST_SHOT * duration, np.inf
    try:
        for _ in range(_SHOTS):
            size = sizes(system, x, duration)
            later, derivative = system.flow(x, 0.0, duration)
            start = np.asarray(system.velocity(x)) * duration / size
            end = turn @ np.asarray(system.velocity(later)) * duration / size
            residual = (turn @ later - x) / size
            moved = float(np.linalg.norm(start))
            off = float(np.abs(residual).max())
            if not off <= 2.0 * best or moved <= _SETTLED:
                return None
            if off <= _CLOSED * moved:
                return x, section_at(system, x, size, duration)
            best = min(best, off)
            closing = (turn @ derivative) * size / size[:, None] - np.eye(x.size)
            bordered = np.block([[closing, end[:, None]], [start[None] / moved, np.zeros((1, 1))]])
            move = np.linalg.lstsq(bordered, np.append(-residual, 0.0), rcond=_SINGULAR)[0]
            move *= min(1.0, _FARTHEST_MOVE * min(1.0, moved) / float(np.abs(move[:-1]).max(initial=0.0) or np.inf))
            x = x + move[:-1] * size
            duration *= 1.0 + float(np.clip(move[-1], -_FARTHEST_STRETCH, _FARTHEST_STRETCH))
            if duration > longest:
                return None
    except (AnalysisError, np.linalg.LinAlgError):
        return None
    return None


def _onward(system: SystemLike, x: Array) -> list[tuple[Array, Section | None]]:
    """A state further along the motion, where every state may be time 0: in the guess itself something may just have
    happened, such as an impact, and a motion that ends there ends before it or after it by round-off."""
    if not isinstance(system, Autonomous):
        return []
    try:
        return [(system.flow(np.array(x), 0.0, _ONWARD * return_duration(system))[0], None)]
    except AnalysisError:
        return []


def _settled(system: SystemLike, x: Array) -> list[tuple[Array, Section | None]]:
    """States on the orbit that attracts the motion from a state, if one does, with sections across it."""
    if is_autonomous(system):
        return _settled_autonomous(system, x)
    found: list[tuple[Array, Section | None]] = []
    for count in (_LONGEST_SETTLING // 10, _LONGEST_SETTLING):
        try:
            for _ in range(count):
                x = returned_states(system, x[None])[0]
        except AnalysisError:
            break
        if not np.isfinite(x).all():
            break
        found.append((x, None))
    return found


def _settled_autonomous(system: Autonomous, x: Array) -> list[tuple[Array, Section | None]]:
    """As :func:`_settled`, with a new guess of the period: when the motion first comes close to where it was."""
    step = system.guess_period / _MARCHED
    whole = whole_period(system)
    try:
        for _ in range(_LONGEST_SETTLING // 4):
            x = whole.flow(x, 0.0, system.guess_period)[0]
        path = [x]
        for _ in range(_MARCHES * _MARCHED):
            path.append(whole.flow(path[-1], 0.0, step)[0])
    except AnalysisError:
        return []
    states = np.array(path)
    if not np.isfinite(states).all():
        return []
    # A state that hardly moves, for its size, tells nothing.
    size = sizes(system, x, system.guess_period)
    moves = np.ptp(states, axis=0) / size
    size = size * np.maximum(moves, _STILL * moves.max())
    if not size.all():
        return []
    away = (np.abs(states - x) / size).max(axis=1)
    turned = np.flatnonzero((away[1:-1] <= away[:-2]) & (away[1:-1] <= away[2:]) & (away[1:-1] < _COMES_BACK)) + 1
    if not turned.size:
        return []
    count = 1 if system.symmetry is None else returns_per_period(system)
    return [(x, section_at(system, x, None, float(turned[0]) * step / count))]
