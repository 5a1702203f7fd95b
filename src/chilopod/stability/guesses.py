"""States nearer to a periodic orbit than a guess: where Newton's method starts from once it has failed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.stability.capabilities import Autonomous, SystemLike, is_autonomous, returns_per_period
from chilopod.stability.returns import Section, return_duration, returned_states, section_at, whole_period
from chilopod.stability.scales import sizes

Array = NDArray[np.float64]

_SHOTS, _LONGEST_SHOT = 20, 4.0  # rounds, and guessed periods
_FARTHEST_MOVE = 0.3  # of the sizes, and of how far the motion would go at its speed, in a move of Newton's method
_FARTHEST_STRETCH = 0.3  # likewise of the period
_CLOSED = 1e-6  # of the same: a motion that about closes
_ONWARD = 0.382  # of the guessed return, where a guess is of no use
_LONGEST_SETTLING = 300  # returns
_MARCHED, _MARCHES = 48, 8  # steps a guessed period, and guessed periods, in which a motion is to come back
_COMES_BACK = 0.1  # of its size
_STILL = 1e-3  # of how much the others move
_SINGULAR = 1e-13  # singular values that count as zero, the largest being one
_AT_REST = 1e-10  # of the sizes: a motion that short leads nowhere


def nearer_states(system: SystemLike, x: Array) -> Iterator[tuple[Array, Section | None]]:
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
            if not off <= 2.0 * best or moved <= _AT_REST:
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
