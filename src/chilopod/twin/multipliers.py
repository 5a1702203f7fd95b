"""Floquet multipliers of a walk in MuJoCo: of the cycle map's derivative, and of bends of a given size.

A foot that just touches makes the cycle map jump. A derivative exists only if the walk closes, and it holds for bends
that change no contact. Bends of a given size are therefore followed besides: opposite ones along the leading modes,
brought back to their size after every cycle. The mean over the cycles of the matrix that maps them has the multipliers
of that size, with an interval from its scatter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from chilopod import statistics
from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import Array, ComplexArray
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability.krylov import whole_pairs
from chilopod.stability.problem.returns import ReturnMap
from chilopod.stability.spectrum.eigenvalues import Spectrum, phased, spectrum
from chilopod.twin.cycle_map import CycleMap
from chilopod.twin.legs import servo_targets, twin_of
from chilopod.twin.model import Edit, TwinModel
from chilopod.twin.modes import CycleMode, CycleMultipliers

AMPLITUDE = math.radians(1.0)
"""Default size of a bend, rad: the standard deviation of the trials' disturbance."""

_LEADING = 3
_SETTLING, _NEWTON = 30, 40  # cycles
_CLOSED = 1e-11  # m, rad, per second
_STEPS = (1e-6, 1e-7, 1e-8)  # of the differences; the first that changes no contact
_SHORTER = 0.25  # second step over the first
_REACHES = 10.0 ** np.arange(-6.0, -1.9, 0.5)  # rad
_FORGOTTEN, _BLOCK = 2, 4  # cycles
_LARGER = 4.0  # times the first bends, beyond which they begin anew
_COMPARED = 6  # most cycles whose contacts are named
_NOT_BENT = 1e-9  # part of a mode of length 1
_WHOLE = 1e-9  # of a cycle


def walk_multipliers(
    robot: Robot,
    *,
    amplitude: float = AMPLITUDE,
    cycles: int = 20,
    edit: Edit | None = None,
    warm_start: bool = True,
    threads: int = 0,
    progress: Progress = silent,
) -> CycleMultipliers:
    """Leading Floquet multipliers and modes of the straight walk of the robot in three dimensions.

    Parameters
    ----------
    robot
        Robot with a table [twin].
    amplitude
        Size of the finite bends, rad.
    cycles
        Number of cycles that they are followed, at least 12.
    edit
        See :class:`chilopod.twin.Edited`.
    warm_start, threads
        See :class:`CycleMap`.
    progress
        Function that shows progress.

    Raises
    ------
    ParameterError
        If a gait cycle is no whole number of control intervals, or steps are too coarse for the servos.
    AnalysisError
        If the walk falls.
    """
    cycle, plan = cycle_map(robot, edit=edit, warm_start=warm_start, threads=threads)
    names = [f"yaw{i}" for i in range(1, robot.body.modules)]
    standing = cycle.reduced(plan.initial_positions(), np.zeros(plan.model.nv))
    period = robot.gait.period
    return cycle_multipliers(robot.name, cycle, standing, names, period, amplitude, cycles, progress)


def cycle_map(
    robot: Robot, *, edit: Edit | None = None, warm_start: bool = True, threads: int = 0
) -> tuple[CycleMap, TwinModel]:
    """Cycle map of the robot in three dimensions, and its model; errors see :func:`walk_multipliers`."""
    twin = twin_of(robot)
    count = robot.gait.period / twin.control_interval
    if abs(count - round(count)) > _WHOLE * count:
        allowed = "a whole part of a gait cycle"
        raise ParameterError(
            "must repeat with the gait",
            field="twin.control_interval",
            value=f"{twin.control_interval:g} s",
            allowed=allowed,
        )
    coarse = 2.0 * twin.joint_inertia / max(twin.servo_damping, 1e-300)
    if twin.timestep > coarse:
        said, value = "must be shorter for the damping of the servos", f"{1e3 * twin.timestep:g} ms"
        raise ParameterError(said, field="twin.timestep", value=value, allowed=f"at most {1e3 * coarse:.3g} ms")
    plan = TwinModel(robot, edit=edit)
    control = np.zeros((round(count), plan.model.nu))
    targets = servo_targets(robot, np.arange(len(control)) * twin.control_interval)
    control[:, plan.leg_controls.ravel()] = targets.reshape(len(control), -1)
    control = np.repeat(control, plan.steps_per_control, axis=0)
    return CycleMap(plan.model, control, warm_start=warm_start, threads=threads), plan


def cycle_multipliers(
    name: str,
    cycle: CycleMap,
    start: Array,
    bends: Sequence[str],
    period: float,
    amplitude: float = AMPLITUDE,
    cycles: int = 20,
    progress: Progress = silent,
) -> CycleMultipliers:
    """Leading multipliers of any periodic gait in MuJoCo, near the motion that settles from a start.

    Parameters
    ----------
    name
        Name of the robot.
    cycle, start
        Map of a cycle, and coordinates from which it settles, (dimension,).
    bends
        Names of the coordinates by which modes are scaled and named.
    period
        Period of the gait, s.
    amplitude, cycles, progress
        See :func:`walk_multipliers`.
    """
    if not 0.0 < amplitude < 1.0:
        raise ParameterError(
            "must be a small angle", field="amplitude", value=amplitude, allowed="above 0, below 1 rad"
        )
    if cycles < 3 * _BLOCK:
        raise ParameterError("must be more", field="cycles", value=cycles, allowed=f"{3 * _BLOCK} or more")
    at = np.array([cycle.names.index(each) for each in bends])
    x = start[None]
    for i in range(_SETTLING):
        progress(0.2 * i / _SETTLING, "walks")
        x = cycle(x)
    progress(0.2, "derivative")
    jacobian = _differences(cycle, x, _STEPS[-1])[0]
    progress(0.4, "closes the cycle")
    closed = _closed(cycle, x, jacobian)
    exact: tuple[CycleMode, ...] = ()
    found = None
    if closed is not None:
        progress(0.5, "derivative")
        found = _derivative(cycle, closed)
        x, jacobian = (closed, found[0]) if found else (x, jacobian)
    spec = spectrum(ReturnMap(x[0], jacobian, 0.0, 1, period))
    count = whole_pairs(spec.values, _LEADING)
    basis, dual = _real_basis(spec, count, at)
    reach = math.nan
    contacts: tuple[str, ...] = ()
    if found:
        errors = spec.error[:count] + _errors(cycle, x, spec, count, _SHORTER * found[1])
        exact = tuple(
            CycleMode(complex(spec.values[i]), float(errors[i]), _scaled(spec.right[at, i]), period)
            for i in range(count)
            if spec.values[i].imag >= 0.0
        )
        reach, contacts = _reach(cycle, x, basis)
    progress(0.8, "bends")
    matrices, seen = _followed(cycle, x, amplitude * basis, dual / amplitude, cycles)
    finite = _mean_modes(matrices, basis[at], period)
    images, counts = cycle.with_contacts(seen)
    if not found:
        different = np.sort(np.unique(counts, axis=0, return_index=True)[1])[:_COMPARED]
        contacts = _changing(cycle, [cycle.contacts(each) for each in seen[different]])
    mismatch = float(np.abs(images - seen).max(axis=1)[-1])
    return CycleMultipliers(
        name, x[0], mismatch, exact, reach, amplitude, finite, np.ptp(seen[:, at], axis=0), contacts
    )


def _differences(cycle: CycleMap, x: Array, step: float) -> tuple[Array, bool]:
    """Derivative of the map at a state (1, n) by central differences, and True if none of them changes a contact."""
    shifts = step * np.eye(x.size)
    images, counts = cycle.with_contacts(np.concatenate([x, x + shifts, x - shifts]))
    ahead, behind = images[1 : 1 + x.size], images[1 + x.size :]
    return (ahead - behind).T / (2.0 * step), bool((counts == counts[0]).all())


def _derivative(cycle: CycleMap, x: Array) -> tuple[Array, float] | None:
    """Derivative at a fixed point, and the step of its differences; None if every step changes contacts."""
    for step in _STEPS:
        derivative, same = _differences(cycle, x, step)
        if same:
            return derivative, step
    return None


def _errors(cycle: CycleMap, x: Array, spec: Spectrum, count: int, step: float) -> Array:
    """Errors of leading multipliers, (count,), to first order |left^H| |M right - value right|, where M right is a
    difference along the mode with another step."""
    modes = spec.right[:, :count]
    shifts = step * np.concatenate([modes.real, modes.imag], axis=1).T
    images = cycle(np.concatenate([x + shifts, x - shifts]))
    ahead, behind = np.split(images, 2)
    real, imaginary = np.split((ahead - behind).T / (2.0 * step), 2, axis=1)
    off = real + 1j * imaginary - modes * spec.values[:count]
    return np.asarray((np.abs(spec.left[:, :count]) * np.abs(off)).sum(axis=0))


def _closed(cycle: CycleMap, x: Array, jacobian: Array) -> Array | None:
    """Fixed point near a state (1, n) by Newton's method with one derivative; None if it does not converge."""
    inverse = np.linalg.inv(np.eye(x.size) - jacobian)
    try:
        for _ in range(_NEWTON):
            off = cycle(x) - x
            if np.abs(off).max() < _CLOSED:
                return x
            x = x + off @ inverse.T
    except AnalysisError:  # it falls
        pass
    return None


def _real_basis(spec: Spectrum, count: int, at: NDArray[np.intp]) -> tuple[Array, Array]:
    """Real basis of the leading modes, (n, count), and its dual. The largest bend of a mode is 1, or, if it has none,
    its largest entry."""
    columns, rows = [], []
    for i in range(count):
        if spec.values[i].imag >= 0.0:
            mode = spec.right[:, i]
            bent = mode[at[np.abs(mode[at]).argmax()]]
            mode = mode / (bent if abs(bent) > _NOT_BENT else mode[np.abs(mode).argmax()])
            paired = spec.values[i].imag > 0.0
            columns += [mode.real, mode.imag][: 1 + paired]
            rows += [spec.left[:, i].real, spec.left[:, i].imag][: 1 + paired]
    basis, left = np.array(columns).T, np.array(rows)
    return basis, np.linalg.solve(left @ basis, left)


def _followed(cycle: CycleMap, x: Array, bends: Array, dual: Array, cycles: int) -> tuple[Array, Array]:
    """Matrices that map bends (n, r) in each of some cycles, (cycles, r, r), and the states between, (cycles, n)."""
    count, first = bends.shape[1], bends
    matrices, seen = [], []
    for _ in range(_FORGOTTEN + cycles):
        images = cycle(np.concatenate([x + bends.T, x - bends.T, x]))
        after = 0.5 * (images[:count] - images[count:-1]).T
        matrices.append(dual @ after)
        bends = after @ np.linalg.pinv(matrices[-1])
        if np.abs(bends).max() > _LARGER * np.abs(first).max():  # a jump has turned them all to one side
            bends = first
        seen.append(x[0])
        x = images[-1:]
    return np.array(matrices[_FORGOTTEN:]), np.array(seen[_FORGOTTEN:])


def _mean_modes(matrices: Array, angles: Array, period: float) -> tuple[CycleMode, ...]:
    """Modes of the mean of matrices (cycles, r, r), with intervals; rows of ``angles`` (joints, r) are yaw joints."""
    spec = spectrum(ReturnMap(np.zeros(len(matrices[0])), matrices.mean(axis=0), 0.0, 1, period))
    # To first order, a cycle changes an eigenvalue by left^H (M - mean) right.
    each = np.einsum("ji,kjl,li->ki", spec.left.conj(), matrices, spec.right)
    whole = len(each) // _BLOCK * _BLOCK
    blocks = each[-whole:].reshape(-1, _BLOCK, each.shape[1]).mean(axis=1)
    modes = []
    for i, value in enumerate(spec.values):
        if value.imag >= 0.0:
            parts = [statistics.mean(part).interval for part in (blocks[:, i].real, blocks[:, i].imag)]
            error = math.hypot(*(0.5 * (part.high - part.low) for part in parts[: 1 + (value.imag > 0.0)]))
            modes.append(CycleMode(complex(value), error, _scaled(angles @ spec.right[:, i]), period))
    return tuple(modes)


def _scaled(angles: ComplexArray) -> ComplexArray:
    """Angles of a mode, (N-1,), the largest of which becomes 1; zero if none turns."""
    largest = np.abs(angles).max()
    return np.asarray(phased(angles) / largest) if largest > _NOT_BENT else np.zeros_like(angles)


def _reach(cycle: CycleMap, x: Array, basis: Array) -> tuple[float, tuple[str, ...]]:
    """Largest bend along modes that changes no contact, rad, and the contacts that the next larger one changes."""
    sides = np.concatenate([basis.T, -basis.T])
    states = (x + _REACHES[:, None, None] * sides).reshape(-1, x.size)
    counts = cycle.with_contacts(np.concatenate([x, states]))[1]
    changed = (counts[1:] != counts[0]).any(axis=1)
    if not changed.any():
        return float(_REACHES[-1]), ()
    first = int(changed.argmax())
    size = first // len(sides)
    states = [x[0], states[first]]
    return float(_REACHES[max(size - 1, 0)]), _changing(cycle, [cycle.contacts(each) for each in states])


def _changing(cycle: CycleMap, touching: list[dict[str, NDArray[np.bool_]]]) -> tuple[str, ...]:
    """Geoms whose contacts differ between cycles, and when, in words."""
    found, never = [], np.zeros(len(cycle.control), dtype=np.bool_)
    timestep = float(cycle.model.opt.timestep)
    for name in sorted(set().union(*touching)):
        steps = np.array([each.get(name, never) for each in touching])
        differs = np.flatnonzero((steps != steps[0]).any(axis=0))
        if differs.size:
            first, last = differs[0] * timestep, (differs[-1] + 1) * timestep
            found.append((differs.size, f"{name} at {first:.3f} to {last:.3f} s"))
    return tuple(words for _, words in sorted(found, key=lambda each: -each[0]))
