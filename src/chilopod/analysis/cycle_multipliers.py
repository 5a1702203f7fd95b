"""Floquet multipliers of a walk in MuJoCo: of the cycle map's derivative, and of bends of a given size.

A foot that just touches makes the cycle map jump. A derivative exists only if the walk closes, and it holds for bends
that change no contact. Bends of a given size are therefore followed besides: opposite ones along the leading modes,
brought back to their size after every cycle. The mean over the cycles of the matrix that maps them has the multipliers
of that size, with errors by its scatter and by what differs to both sides. That of tiny bends refines the derivative's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig

from chilopod import units
from chilopod.analysis.cycle_modes import CycleMode, CycleMultipliers
from chilopod.engine import Engine, engine_named
from chilopod.engine.arguments import as_array, require
from chilopod.errors import AnalysisError, ParameterError, known_names
from chilopod.flows.arguments import checked_count
from chilopod.frozen import Array
from chilopod.robot import Robot
from chilopod.stability.krylov import whole_pairs
from chilopod.stability.spectrum import eigensystem, falling
from chilopod.statistics import Interval, half_interval

if TYPE_CHECKING:
    from chilopod.twin import CycleMap

_Modes = tuple[CycleMode, ...]
_Indices = NDArray[np.intp]

AMPLITUDE = math.radians(1.0)
"""Default size of a bend, rad: the standard deviation of the trials' disturbance."""

_LEADING = 3  # multipliers
_SETTLING, _STALLED = 30, 120  # cycles: to settle, and more where feet have decided anew until then
_CLOSING, _TRIED, _MEMORY = 150, 30, 30  # cycles of Anderson's method: most, those if it comes no nearer, that it keeps
_NEARER, _APART = 300, 0.75  # cycles in which a walk comes nearer to a fixed point that it settles into; part left
_CLOSED = 1e-11  # m, rad, per second
LEAST = 1e-8  # size of a bend
_STEPS = (1e-7, LEAST)  # of the differences; the first that changes no contact
_ROUNDING = float(np.finfo(float).eps)
_SHORTER, _KINK, _ACROSS = 0.25, 1e-3, 4  # second step over the first; least change of slopes; directions across
_LARGEST, _HALVINGS = 1e-2, 4  # bends, rad
_FORGOTTEN, _BLOCK, _MOST_CYCLES = 2, 4, 10_000  # cycles
_LARGER = 4.0  # times the first bends, beyond which they begin anew
_NOT_BENT = 1e-3  # part of a mode, above its rounding: a smaller one would bend by 1° at 1000° per second
_HEADING = "the heading"  # see CycleMap.depends_on_place
_RIM = 12  # points of a circle
_MOST = 8  # multipliers between the ends of an interval that has an onset
_DRIFT, _EVEN = 0.2, 2.0  # m, rad, per second, in all cycles that are followed; largest change over the least


def walk_multipliers(
    robot: Robot, engine: str | Engine = "twin", *, amplitude: float = AMPLITUDE, cycles: int = 20
) -> CycleMultipliers:
    """Leading Floquet multipliers and modes of the straight walk of a robot in an engine that has its cycle map: the
    twin, also as :class:`chilopod.twin.Edited`; ``amplitude`` and ``cycles`` see :func:`cycle_multipliers`. The
    straight walk has given way if, at the end, a yaw joint bends in the mean over a cycle by more than ``amplitude``
    and by more than any of them swings within the cycle; the multipliers are then those of the walk that follows.
    ParameterError if the engine has no cycle map, or that has none of this robot, see
    :func:`chilopod.twin.walk_cycle`; AnalysisError if the walk falls."""
    known: Any = engine_named(engine) if isinstance(engine, str) else engine
    if not hasattr(known, "walk_cycle"):
        said, allowed = "has no state that can be divided by its place", "twin, or a chilopod.twin.Edited"
        raise ParameterError(said, field="engine", value=engine, allowed=allowed)
    cycle, standing = known.walk_cycle(robot)
    names = [f"yaw{i}" for i in range(1, robot.body.modules)]
    return _found(robot.name, cycle, standing, names, amplitude, cycles, straight=True)


def cycle_multipliers(
    name: str, cycle: CycleMap, start: Array, bends: Sequence[str], amplitude: float = AMPLITUDE, cycles: int = 20
) -> CycleMultipliers:
    """Leading multipliers of any periodic gait in MuJoCo, near the motion that settles from a start.

    ParameterError if an argument is none of these; AnalysisError if the walk falls before multipliers of smallest bends
    are known, moves on in a coordinate in every cycle, or depends on its place.

    Parameters
    ----------
    name, cycle, start
        Name of the robot, map of a cycle, and coordinates from which it settles, (n,).
    bends, amplitude, cycles
        Names of the coordinates by which modes are scaled and named, size of finite bends in their unit, and the
        number of cycles that they are followed, at least 12.
    """
    return _found(name, cycle, start, bends, amplitude, cycles, straight=False)


def _found(
    name: str, cycle: CycleMap, start: Array, bends: Sequence[str], amplitude: float, cycles: int, straight: bool
) -> CycleMultipliers:
    """Multipliers of :func:`cycle_multipliers`, and whether a walk that is to be straight has given way."""
    if not (isinstance(amplitude, Real) and LEAST <= amplitude < 1.0):
        allowed = f"{LEAST:g} or more, which rounding does not hide, below 1, in the unit of the bends (rad)"
        raise ParameterError("must be a small number", field="amplitude", value=amplitude, allowed=allowed)
    checked_count("cycles", cycles, _MOST_CYCLES, 3 * _BLOCK)
    at = _indices(cycle, bends)
    x = as_array("start", start)
    if x.shape != (len(cycle.names),) or not np.isfinite(x).all():
        allowed = f"{len(cycle.names)} finite numbers: {', '.join(cycle.names)}"
        raise ParameterError("must be the coordinates of a state", field="start", value=x.tolist(), allowed=allowed)
    x, closes = _closed(cycle, x)
    place = cycle.depends_on_place(x)
    if place not in ("", _HEADING):
        allowed = "a world that looks the same from everywhere along `travel`, and from wherever a free body stands"
        raise AnalysisError(f"must not depend on {place}, which is divided out", field="motion", allowed=allowed)
    for step in _STEPS:
        derivative, ahead = _derivative(cycle, x, step)
        basis, dual = _leading(derivative, at)
        beside = np.concatenate([ahead, _switched(cycle, x, basis, step)])
        if not len(beside):
            break
    exact = _exact(cycle, x, derivative, basis, dual, at, step) if closes and not len(beside) else ()
    try:
        finite, seen = _finite(cycle, x, basis, dual, at, amplitude, cycles)
    except AnalysisError:  # so large bends fall
        if not exact:
            raise
        finite, seen = (), np.array([x, cycle(x[None])[0][0]])
    given_way = _given_way(cycle, seen[-1], at, amplitude) if straight else None
    if not exact and given_way is None:
        _check_settled(cycle, seen)
    others = np.concatenate([x[None], beside]) if closes else seen
    reach, contacts = _reach(cycle, x, basis, step) if exact else (None, cycle.changing(others))
    ahead, here = (cycle(x[None])[0][0], x) if closes else (seen[-1], seen[-2])  # beside an unstable walk others wander
    mismatch, spread = float(np.abs(ahead - here).max()), np.ptp(seen[:, at], axis=0)
    unit = cycle.units[at[0]] if len({cycle.units[each] for each in at}) == 1 else ""
    found_at = name, cycle.period, x, mismatch, exact, reach, amplitude, finite, spread, contacts, unit
    return CycleMultipliers(*found_at, heading=bool(place), switch=closes and not exact, given_way=given_way)


def finite_modes(
    cycle: CycleMap,
    start: Array,
    bends: Sequence[str],
    amplitude: float = AMPLITUDE,
    cycles: int = 20,
    basis: tuple[Array, Array] | None = None,
) -> tuple[tuple[CycleMode, ...], Array, tuple[Array, Array]]:
    """Leading modes of bends of a given size alone, by falling modulus, :func:`cycle_multipliers` at half its cost. The
    arguments are the same, and ``basis``, leading modes (n, r) and their dual (r, n) of a similar walk that has settled
    at ``start``. Returns the modes, with errors by scatter alone, the settled state, (n,), and the basis."""
    at, x = _indices(cycle, bends), as_array("start", start)
    for _ in range(_SETTLING if basis is None else _FORGOTTEN * _BLOCK):
        x = cycle(x[None])[0][0]
    forgotten = _FORGOTTEN if basis is None else _BLOCK
    modes, dual = basis or _leading(_derivative(cycle, x, _STEPS[0])[0], at)
    matrices = _followed(cycle, x, amplitude * modes, dual / amplitude, forgotten + cycles)[0]
    return _modes(matrices[forgotten:], modes[at], _BLOCK), x, (modes, dual)


def _indices(cycle: CycleMap, bends: Sequence[str]) -> _Indices:
    """Indices of coordinates with these names."""
    from chilopod.twin import CycleMap

    require(isinstance(cycle, CycleMap), "must be a chilopod.twin.CycleMap", "cycle", type(cycle).__name__)
    fits = len(bends) and not isinstance(bends, str)
    require(fits, "must be a list of names", "bends", bends, ", ".join(cycle.names))
    known_names(bends, cycle.names, "bends", "must be a coordinate")
    return np.array([cycle.names.index(each) for each in bends])


def _given_way(cycle: CycleMap, x: Array, at: _Indices, amplitude: float) -> tuple[str, float] | None:
    """Name and mean over a cycle of the joint that bends most, if it is beyond a size and the joints' swing: in a
    straight walk each half of the cycle mirrors the other, and the mean is 0."""
    path = cycle.path(x)[:, at]
    means, most = path.mean(axis=0), int(np.abs(path.mean(axis=0)).argmax())
    bends = abs(means[most]) > max(amplitude, 0.5 * np.ptp(path, axis=0).max())
    return (cycle.names[at[most]], float(means[most])) if bends else None


def _check_settled(cycle: CycleMap, seen: Array) -> None:
    """AnalysisError if a coordinate changes by about the same in each cycle, from states before each, (cycles, n)."""
    moves = np.diff(seen, axis=0)
    least, most = np.abs(moves).min(axis=0), np.abs(moves).max(axis=0)
    even = (np.abs(np.sign(moves).sum(axis=0)) == len(moves)) & (most <= _EVEN * least)
    if (on := even & (np.abs(moves.sum(axis=0)) > _DRIFT)).any():
        name, move = cycle.names[on.argmax()], f"{moves[-1, on.argmax()]:.3g} {cycle.units[on.argmax()]}"
        allowed = "a motion that settles, beside the joints that are named as the travel of its CycleMap"
        raise AnalysisError(f"must repeat: {name} changes by {move} in each cycle", field="motion", allowed=allowed)


def _closed(cycle: CycleMap, x: Array) -> tuple[Array, bool]:
    """State (n,) of a settled walk, and whether it repeats: the fixed point nearby by Anderson's method, if found. One
    that is farther than the walk has moved counts if the walk comes nearer to it: that method jumps. From where
    the walk is then, or from where a walk that has stalled or still settles is, it begins once more. The state is that
    of the first try if none is found."""
    first: list[Array] = []
    for cycles in (_SETTLING, _STALLED, _NEARER):
        begun, moves = x, [np.inf]
        for _ in range(cycles):
            before, x = x, cycle(x[None])[0][0]
            moves.append(float(np.abs(x - before).max()))
        settled, fixed = x, _fixed(cycle, x)
        first = first or [settled]
        if fixed is None and not (np.diff(moves[-_SETTLING // 2 :]) < 0.0).all():
            if cycles == _SETTLING:
                continue
            break
        apart = np.inf if fixed is None else float(np.abs(fixed - settled).max())
        if fixed is not None and apart <= np.abs(settled - begun).max():
            return fixed, True
        for _ in range(_NEARER):
            x = cycle(x[None])[0][0]
            if fixed is not None and np.abs(fixed - x).max() < _APART * apart:
                return fixed, True
    return first[0], False


def _fixed(cycle: CycleMap, x: Array) -> Array | None:
    """Fixed point by Anderson's method, if found."""
    before: list[tuple[Array, Array]] = []
    with suppress(AnalysisError):  # it falls
        for tried in range(_CLOSING):
            off = cycle(x[None])[0][0] - x
            if np.abs(off).max() < _CLOSED:
                return x
            before = [*before[-_MEMORY:], (x, off)]
            if tried == _TRIED and np.abs(off).max() >= np.abs(before[0][1]).max():
                break
            moves, changes = np.diff(before, axis=0).transpose(1, 2, 0)
            x = x + off - (moves + changes) @ np.linalg.lstsq(changes, off, rcond=None)[0]
    return None


def _derivative(cycle: CycleMap, x: Array, step: float) -> tuple[Array, Array]:
    """Derivative at a state (n,) by differences to one side, and those states of them whose contacts are others."""
    beside = x + step * np.eye(x.size)
    images, counts = cycle(np.concatenate([x[None], beside]))
    return (images[1:] - images[0]).T / step, beside[(counts[1:] != counts[0]).any(axis=1)]


def _switched(cycle: CycleMap, x: Array, basis: Array, step: float) -> Array:
    """States a step to both sides of a state (n,), along a basis (n, r) and across any switch, whose contacts are other
    ones, or where slopes to both sides differ by what hardly falls with the step."""
    across = np.random.default_rng(0).choice([-1.0, 1.0], (_ACROSS, x.size))
    along = np.concatenate([basis.T, across / math.sqrt(x.size)])
    beside = x + step * np.concatenate([along, -along])
    images, counts = cycle(np.concatenate([x[None], beside, x + _SHORTER * (beside - x)]))
    moves = images[1:] - images[0]
    apart, nearer = np.abs(moves.reshape(2, 2, len(along), -1).sum(axis=1)).max(axis=2)
    kinks = (apart > _KINK * (step + np.abs(moves).max())) & (nearer > _SHORTER**1.5 * apart)  # a curve falls by 2
    return beside[(counts[1 : len(beside) + 1] != counts[0]).any(axis=1) | np.tile(kinks, 2)]


def _leading(derivative: Array, at: _Indices) -> tuple[Array, Array]:
    """Real basis of the leading modes, (n, r), of which the largest bend, or without one entry, is 1; and its dual. The
    last ones are left out if only the others can be told from the rest, as those that die out within a cycle."""
    # Left eigenvectors of their own: the inverse of the right ones is lost if any mode at all is defective.
    values, left, right = eig(derivative, left=True)
    order = falling(values)
    values, left, right = values[order], left[:, order], right[:, order]
    for count in range(_LEADING, 0, -1):
        kept = np.arange(whole_pairs(values, count))
        modes, second = right[:, kept] / _largest(right[:, kept], at), values[kept].imag < 0.0
        basis = np.where(second, modes.imag, modes.real)
        rows = np.where(second, left[:, kept].imag, left[:, kept].real).T
        dual = np.linalg.pinv(rows @ basis) @ rows
        if np.abs(dual @ basis - np.eye(kept.size)).max() < _KINK:
            break
    return basis, dual


def _largest(modes: NDArray[Any], at: _Indices) -> NDArray[Any]:
    """Largest bend of each of some modes (n, r), or, if it has none, its largest entry."""
    size = np.abs(modes)
    size[at] /= _NOT_BENT
    return modes[size.argmax(axis=0), np.arange(modes.shape[1])]


def _followed(cycle: CycleMap, x: Array, bends: Array, dual: Array, cycles: int) -> tuple[Array, Array, Array]:
    """Matrices that map bends (n, r) in each of some cycles, (cycles, r, r), states before each, (cycles, n), and the
    same matrices by bends to one side and to the other, (cycles, 2, r, r)."""
    first, matrices, seen, sides = bends, [], [], []
    for _ in range(cycles):
        seen.append(x)
        *images, x = cycle(np.concatenate([x + bends.T, x - bends.T, x[None]]))[0]
        ahead, behind = np.split(np.array(images), 2)
        after = 0.5 * (ahead - behind).T
        matrices.append(dual @ after)
        sides.append([dual @ (ahead - x).T, dual @ (x - behind).T])
        bends = after @ np.linalg.pinv(matrices[-1])
        if np.abs(bends).max() > _LARGER * np.abs(first).max():  # a jump has turned them all to one side
            bends = first
    return np.array(matrices), np.array(seen), np.array(sides)


def _exact(
    cycle: CycleMap, x: Array, derivative: Array, basis: Array, dual: Array, at: _Indices, step: float
) -> _Modes:
    """Modes of the derivative, by bends of two tiny sizes; slopes to both sides that differ are part of the error, and
    so is what rounding of the derivative moves, also through modes that are left out."""
    tiny = [_followed(cycle, x, size * basis, dual / size, 1) for size in (step, _SHORTER * step)]
    of_images = _ROUNDING * np.abs(x).max() / (_SHORTER * step)
    far, near = (np.diff(each[2], axis=1)[0] for each in tiny)
    kink = (near - _SHORTER * far) / (1.0 - _SHORTER)  # without what falls with the size
    modes = _modes(np.concatenate([each[0] for each in tiny]), basis[at], 1, _ROUNDING + of_images, kink)
    error = float(_ROUNDING * np.linalg.norm(derivative, 2) + of_images)
    moves = spectral_moves(derivative, [mode.multiplier for mode in modes], error)
    return tuple(replace(mode, error=max(mode.error, move)) for mode, move in zip(modes, moves, strict=True))


def spectral_moves(matrix: Array, near: Sequence[complex], error: float) -> list[float]:
    """Distances within which an error of a matrix (n, n), in the 2-norm, keeps its eigenvalues nearest to some numbers:
    radii of the first circles round them that no eigenvalue of matrices with that error meets. They grow by factors of
    2; those of eigenvalues that meet the others are found too, be they defective or not."""
    values, rim, found = np.linalg.eigvals(matrix), np.exp(2j * np.pi * np.arange(_RIM) / _RIM), []
    for number in near:
        middle, radius = values[np.abs(values - number).argmin()], error
        while np.linalg.svdvals((middle + radius * rim)[:, None, None] * np.eye(len(matrix)) - matrix).min() < error:
            radius *= 2.0
        found.append(radius)
    return found


def _finite(
    cycle: CycleMap, x: Array, basis: Array, dual: Array, at: _Indices, amplitude: float, cycles: int
) -> tuple[_Modes, Array]:
    """Modes of bends of a size, and states before each cycle. Contacts do not add up, and differ to both sides: a bend
    along a single mode, to one side, grows by another factor. The error contains the changes to both sides."""
    bends, dual = amplitude * basis, dual / amplitude
    matrices, seen, _ = (each[_FORGOTTEN:] for each in _followed(cycle, x, bends, dual, _FORGOTTEN + cycles))
    values, right, _ = eigensystem(matrices.mean(axis=0))
    turn = np.where(values.imag < 0.0, right.imag, right.real)
    turn *= np.abs(_largest(bends, at) / _largest(bends @ turn, at))
    back = np.linalg.pinv(turn)
    sides = _followed(cycle, x, bends @ turn, back @ dual, _FORGOTTEN + cycles)[2][_FORGOTTEN:].mean(axis=0)
    return _modes(matrices, basis[at], _BLOCK, apart=turn @ sides @ back - matrices.mean(axis=0)), seen


def _modes(matrices: Array, angles: Array, block: int, least: float = _ROUNDING, apart: Array | None = None) -> _Modes:
    """Modes of the mean of matrices (m, r, r), with half their intervals of 95 % by Student's t, from means over blocks
    of some of them in turn, at ``least`` relative to the norm of a matrix, and with the changes by matrices that lie
    ``apart`` from the mean, (k, r, r); rows of ``angles`` (joints, r) are yaw joints of the basis."""
    values, right, left = eigensystem(matrices.mean(axis=0))
    # To first order, a matrix changes an eigenvalue by left^H (M - mean) right.
    each = np.einsum("ji,kjl,li->ik", left.conj(), matrices, right)
    blocks = each[:, len(matrices) % block :].reshape(len(values), -1, block).mean(axis=2)
    with np.errstate(over="ignore", invalid="ignore"):  # a nearly defective matrix
        errors = half_interval(blocks, axis=1)
        if apart is not None:
            errors += np.abs(np.einsum("ji,kjl,li->ki", left.conj(), apart, right)).sum(axis=0)
        rounding = least * np.linalg.norm(matrices.mean(axis=0)) * np.linalg.norm(left, axis=0)
    errors = np.nan_to_num(np.fmax(errors, rounding), nan=np.inf, posinf=np.inf)
    turns = angles @ right
    largest = turns[np.abs(turns).argmax(axis=0), np.arange(len(values))]
    turns = np.where(np.abs(largest) > _NOT_BENT, turns / np.where(largest == 0.0, 1.0, largest), 0.0)
    return tuple(CycleMode(complex(values[i]), float(errors[i]), turns[:, i]) for i in np.flatnonzero(values.imag >= 0))


def _reach(cycle: CycleMap, x: Array, basis: Array, low: float) -> tuple[float, tuple[str, ...]]:
    """Largest bend along modes that changes no contact, rad, from one that does not; and what a larger one changes."""
    high, differ = _LARGEST, x[None]
    for _ in range(_HALVINGS):
        size = math.sqrt(low * high)
        states = np.concatenate([x[None], x + size * basis.T, x - size * basis.T])
        try:
            counts = cycle(states)[1]
        except AnalysisError:  # so large a bend falls
            high = size
            continue
        changed = (counts != counts[0]).any(axis=1)
        if changed.any():
            high, differ = size, states[[0, changed.argmax()]]
        else:
            low = size
    return low, cycle.changing(differ)


def bend_onset(
    multipliers: Callable[[Robot], CycleMultipliers], robot: Robot, parameter: str, between: tuple[float, float]
) -> Interval:
    """Value of a parameter at which the multiplier of a bend of finite size passes 1, in SI units, by regula falsi
    until 1 lies in the multiplier's interval; that interval over the slope is the interval of the value. Where the
    straight walk has given way, bends grow without a multiplier."""

    def shown(value: float) -> str:
        return units.format(value, robot.unit_of(parameter), digits=6)

    def excess(value: float) -> tuple[float, float]:
        found = multipliers(robot.with_value(parameter, value))
        if found.given_way:
            return math.inf, 0.0
        bends = [mode for mode in found.finite if mode.shape == "bend"]
        if not bends:
            raise AnalysisError("has no bend among its leading modes", field=parameter, value=shown(value))
        return bends[0].multiplier.real - 1.0, bends[0].error

    (a, b), (at_a, at_b) = between, [excess(end)[0] for end in between]
    if at_a * at_b > 0.0:
        gone = "a walk that has given way"
        ends = [f"the multiplier {1.0 + at:.4f}" if math.isfinite(at) else gone for at in (at_a, at_b)]
        said = f"must hold an onset; its ends have {ends[0]} and {ends[1]}"
        given = f"{shown(a)} to {shown(b)}"
        raise ParameterError(said, field="onset", value=given, allowed="values on both sides of 1")
    return crossing(excess, (a, at_a), (b, at_b))


def crossing(
    excess: Callable[[float], tuple[float, float]],
    one: tuple[float, float],
    other: tuple[float, float],
    tolerance: float = 0.0,
) -> Interval:
    """Value at which an excess passes 0, between two values with excesses of different signs, by regula falsi until the
    excess is below its error or the tolerance; its error over the slope is the interval. ``excess`` returns both. An
    interval with an infinite excess is halved."""
    (a, at_a), (b, at_b) = one, other
    for _ in range(_MOST):
        slope = (at_b - at_a) / (b - a)
        value = a - at_a / slope if math.isfinite(slope) else 0.5 * (a + b)
        at, error = excess(value)
        if math.isfinite(slope) and abs(at) <= max(error, tolerance):
            break
        a, at_a, b, at_b = (value, at, b, at_b) if at * at_a > 0.0 else (a, at_a, value, at)
    if not math.isfinite(slope):
        raise AnalysisError("must hold bends that grow, before the straight walk has given way", field="onset")
    value -= at / slope
    return Interval(value, value - error / abs(slope), value + error / abs(slope))
