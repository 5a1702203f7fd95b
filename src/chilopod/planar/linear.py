"""The linearisation about the straight walk (paper eq. 2) and its fundamental solution by Taylor series.

Between two switching instants the perturbation of the reduced state obeys

    dz/dt = (A0 + A1 t + A2 t^2) z,

a polynomial of second degree because the feet move back at constant speed. Substituting z = sum z_k t^k gives the
exact recurrence (k + 1) z_{k+1} = A0 z_k + A1 z_{k-1} + A2 z_{k-2}.

The feet damp motion at rates from 0 to some -rho = -450 /s, and the series of exp(-rho t) cancels itself to nothing.
Therefore the series is that of y = exp(rho t / 2) z, whose rates are centred about zero: its terms add up to the large
growth of the slow modes instead of cancelling, round-off stays relative to the slow modes however long the step, and
one step spans the whole interval between two switches. Springs that ring at a high frequency f beside little damping
still cancel, by exp(|rho/2 + i f| h - rho h / 2), and shorten the step h. The derivation by hand is checked in the
tests against the derivative of the nonlinear model.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from chilopod.compiled import assign, copy_into, njit, parallel_njit
from chilopod.errors import ParameterError
from chilopod.flows import deadline
from chilopod.frozen import Array
from chilopod.planar.contact import C_PP
from chilopod.planar.series import PANEL, ROWS, panels, series_term

TRUNCATION = 1e-17
"""Relative size of the last Taylor term that is kept: an order of magnitude below round-off."""

_LONGEST = 32.0  # radius of the centred rates times the step; e^32 is far from overflow and needs some 100 orders
_CANCELLED = 2.0  # of which so much may be lost to cancellation: a factor e^2 in round-off
_ROUND_OFF = 2.0**-20  # size of the round-off that is carried along, far above the true one and far below the states
_CARRIED, _OWN = 16.0, 128.0  # safety: of that column, and of the largest entry
_MOST_ORDERS = 400
MOST_EXTENDED = 60  # modules; beyond them extended precision takes too long
_KEPT = 24  # terms held before the last three move back to the bottom
_CHECKED = 4


def mass_matrix(modules: int, length: float, mass: float, inertia: float, dtype: Any = float) -> tuple[Any, Any]:
    """Return the mass matrix (N+2, N+2) of the straight chain and its lateral kinematics (N, N+2).

    The velocities are eta = (vx, vy, w_0 .. w_{N-1}): module 1's centre and the *absolute* yaw rates. The lateral
    velocity of module i is lateral[i] eta.
    """
    lateral = np.zeros((modules, modules + 2), dtype)
    lateral[:, 1] = 1.0
    length, mass, inertia = dtype(length), dtype(mass), dtype(inertia)
    for i in range(1, modules):
        lateral[i:, 1 + i] -= 0.5 * length
        lateral[i:, 2 + i] -= 0.5 * length
    matrix = mass * lateral.T @ lateral
    matrix[0, 0] = modules * mass
    matrix[2:, 2:] += inertia * np.eye(modules)
    return matrix, lateral


def rate_differences(modules: int) -> Array:
    """Joint rates as functions of the velocities, shape (N-1, N+2)."""
    rates, joints = np.zeros((modules - 1, modules + 2)), range(modules - 1)
    rates[joints, range(2, modules + 1)] = -1.0
    rates[joints, range(3, modules + 2)] = 1.0
    return rates


def system_matrices(
    length: float, mass: float, inertia: float, speed: float, moments: Array, durations: Array
) -> tuple[Array, Array, Array, Array]:
    """A0, A1, A2 of every interval, for a robot without springs and dampers, and what these add.

    The state is z = (delta vx, delta vy, w_0 .. w_{N-1}, theta_1 .. theta_{N-1}) with *absolute* yaw rates w. A spring
    k_j or damper d_j at joint j puts -k_j theta_j - d_j theta_j' between its modules: column j of ``joint`` times that
    torque.

    Length, mass and inertia are those of a module, SI; ``speed`` is that of the straight walk, m/s; contact moments are
    those at the start of every interval, shape (intervals, N, 8), all legs straight; intervals have durations, s, shape
    (intervals,).

    Returns ``passive``, shape (intervals, N+2, 3, 2N+1), the upper rows of A0, A1, A2 (the lower rows are the same for
    all robots: theta_j' = w_j - w_{j-1}); ``joint``, acceleration of the velocities by a unit torque at a joint, shape
    (N+2, N-1); ``rates``, joint rates as functions of the velocities, shape (N-1, N+2); and ``decay``, the fastest rate
    at which the feet damp motion in every interval, 1/s, shape (intervals,), without springs and dampers, which are for
    :func:`joint_bound`.
    """
    intervals, n, _ = moments.shape
    # The mass matrix of a long chain is nearly singular and turns round-off in what follows into accelerations a
    # thousand times larger; extended precision, where the machine has it, keeps them good to double.
    extended: Any = np.longdouble if n <= MOST_EXTENDED else np.float64
    m, lateral = mass_matrix(n, length, mass, inertia, extended)
    mass, speed = extended(mass), extended(speed)
    c, c_x, c_y, c_xx = np.moveaxis(moments[..., : C_PP + 1].astype(extended), -1, 0)
    # Contact moments that change, as polynomials in time, shape (3, intervals, n).
    cx_t = np.stack([c_x, -speed * c, np.zeros_like(c)])
    cxx_t = np.stack([c_xx, -2.0 * speed * c_x, speed**2 * c])

    # Power of the feet: sum over modules of (vx_i, vy_i, w_i)^T D_i (vx_i, vy_i, w_i), with vy_i = lateral[i] eta.
    drag = np.zeros((3, intervals, n + 2, n + 2), extended)
    drag[0] = (lateral.T * c[:, None]) @ lateral
    drag[0, :, 0, 0] += c.sum(-1)
    drag[0, :, 0, 2:] -= c_y
    drag[0, :, 2:, 0] -= c_y
    cross = np.einsum("psi,ia->psai", cx_t, lateral)
    drag[..., :, 2:] += cross
    drag[..., 2:, :] += np.swapaxes(cross, -1, -2)
    drag[..., range(2, n + 2), range(2, n + 2)] += cxx_t

    # A module that points psi_i away from module 1 meets the floor sideways: vy_i = lateral[i] eta - speed psi_i.
    heading = np.tril(np.ones((n, n - 1), extended), -1)
    sideways = np.zeros((3, intervals, n + 2, n - 1), extended)
    sideways[0] = (lateral.T * c[:, None]) @ heading
    sideways[..., 2:, :] += np.einsum("psi,ij->psij", cx_t, heading)

    force = np.zeros((3, intervals, n + 2, 2 * n + 1), extended)
    force[..., : n + 2] = -drag
    force[..., n + 2 :] = speed * sideways
    force[0, :, :, 2] -= mass * speed * lateral.sum(0)  # module 1's frame turns: vy' = a_y - w0 vx

    rates = rate_differences(n)
    # A power series has no direction of time, so its terms grow as fast as the motion of the interval before, run
    # backwards, would: the mean of the drag from -h to 0 counts too. Within the interval the largest stands at an end,
    # since a foot damps as the square of a linear function of time.
    h = durations[:, None, None]
    drags = np.stack(
        [drag[0], drag[0] + h * (drag[1] + h * drag[2]), drag[0] - h * (drag[1] / 2.0 - h * drag[2] / 3.0)]
    )
    inverse_root = np.linalg.inv(np.linalg.cholesky(m.astype(np.float64)))
    decay: Array = np.linalg.eigvalsh(inverse_root @ drags.astype(np.float64) @ inverse_root.T)[..., -1].max(axis=0)
    columns = np.moveaxis(force, 2, 0).reshape(n + 2, -1)
    solved = solve(m, np.concatenate([columns, rates.T], axis=1))
    passive = solved[:, : columns.shape[1]].reshape(n + 2, 3, intervals, 2 * n + 1)
    passive = np.ascontiguousarray(passive.transpose(2, 0, 1, 3))
    joint = np.ascontiguousarray(solved[:, columns.shape[1] :])
    return passive, joint, rates, decay


def solve(matrix: Any, right: Any) -> Array:
    """Solve with a matrix in extended precision: inverse in double, and two refinements.

    The inverse is refined, not the solution: it has fewer columns, and products in extended precision are slow.
    LAPACK's solver would share a few columns between threads, which takes milliseconds where other work keeps a core.
    """
    double = np.linalg.inv(matrix.astype(np.float64))
    inverse = double.astype(right.dtype)
    for _ in range(2):
        inverse += double @ (np.eye(len(matrix)) - matrix @ inverse).astype(np.float64)
    rounded: Array = (inverse @ right).astype(np.float64)
    return rounded


@njit(fastmath=True)
def _largest(rows: Any) -> float:
    # Column by column first: sixteen maxima side by side are vector operations, one after the other they are not.
    sizes = np.zeros(PANEL)
    for i in range(rows.shape[0]):
        for q in range(PANEL):
            value = abs(rows[i, q])
            sizes[q] = value if value > sizes[q] else sizes[q]
    size = 0.0
    for q in range(PANEL):
        size = sizes[q] if sizes[q] > size else size
    return size


def joint_bound(compliance: Array, torque: Array) -> float:
    """Upper bound on the largest eigenvalue of ``compliance @ diag(torque)``.

    With the accelerations of the joints under unit torques at the joints for ``compliance``, the square of the highest
    frequency (1/s^2) if ``torque`` holds the springs, the fastest decay (1/s) if it holds the dampers.
    """
    return float((np.abs(compliance) @ torque).max())


def steps(widths: Array, decay: Array, frequency: Array | float) -> Array:
    """Approximate number of Taylor steps of :func:`propagate`; intervals come last, robots may be in front."""
    centred = np.hypot(0.5 * decay, frequency)
    found: Array = (widths * np.maximum(centred / _LONGEST, (centred - 0.5 * decay) / _CANCELLED)).sum(-1)
    return found


@njit(inline="always")
def _fill(block: Any, upper: Any, t: float, h: float, shift: float) -> None:
    """h A0 + shift, h^2 A1, h^3 A2 side by side at a time in an interval; A2 acts on the velocities alone."""
    rows, velocities, n = block.shape[0], upper.shape[0], upper.shape[2]
    for i in range(velocities):
        for j in range(n):
            a1, a2 = upper[i, 1, j], upper[i, 2, j]
            block[i, j] = h * (upper[i, 0, j] + t * (a1 + t * a2))
            block[i, rows + j] = h * h * (a1 + 2.0 * t * a2)
            if j < velocities:
                block[i, 2 * rows + j] = h * h * h * a2
        block[i, i] += shift
    for i in range(velocities, n):
        joint = i - velocities
        block[i, joint + 2] = -h
        block[i, joint + 3] = h
        block[i, i] = shift


@njit(inline="always")
def _round(block: Any, state: Any, reach: Any, shift: float, rounded: float, bits: int) -> int:
    """Add the rounding error of a step's matrix, with arbitrary signs, to the last column; return the next bits."""
    n = reach.size
    for i in range(n):
        reach[i] = 0.0
        for q in range(PANEL - 1):
            reach[i] = max(reach[i], abs(state[i, q]))
    for i in range(n):
        size = reach[i]
        for j in range(n):
            entry = abs(block[i, j] - (shift if i == j else 0.0))
            size += (rounded * entry + (shift if i == j else 0.0)) * reach[j]
        bits = (bits * 1103515245 + 12345) & 0x7FFFFFFF
        state[i, PANEL - 1] += _ROUND_OFF * (size if bits & 0x10000 else -size)
    return bits


@njit(inline="always")
def _add_series(block: Any, terms: Any, state: Any) -> tuple[float, int]:
    """Add the series of a step to the state, in place; its largest term, and the number of orders."""
    rows, vectors, total = state.shape[0], panels(terms), panels(state)
    at = (_KEPT - 3) * rows
    assign(terms[at : at + rows], state)
    terms[at + rows :] = 0.0
    peak, orders = 0.0, 0
    for k in range(1, _MOST_ORDERS + 1):
        if at == 0:
            at = (_KEPT - 3) * rows
            assign(terms[at : at + 3 * rows], terms)
        series_term(block, vectors, at, 1.0 / k, total)
        at -= rows
        orders += 1
        # The recurrence uses three orders, so three small terms in a row end it.
        if k % _CHECKED == 0:
            size = _largest(terms[at : at + 3 * rows])
            peak = max(peak, size)
            if size <= TRUNCATION * _largest(state):
                break
    return peak, orders


@njit
def _propagate(widths: Any, upper: Any, decay: Any, frequency: float, clock: float, state: Any, stop: Any) -> Any:
    """Carry one panel of columns through all intervals, in place, unless ``stop`` is set; returns (error, orders).

    ``state`` has 2N+1 rows and then zeros, up to a multiple of ROWS. The error bounds that of the largest entry of the
    result. The effect of round-off depends on the motion, so the last column is a sample of round-off instead of a
    solution: every step adds the rounding error of its matrix, with arbitrary signs, and propagates it.
    """
    velocities, n, rows = upper.shape[1], upper.shape[3], state.shape[0]
    block = np.zeros((rows, 2 * rows + velocities))
    # Terms of the series, the newest on top, so that orders k, k-1, k-2 lie one below the other, for one product.
    terms = np.empty((_KEPT * rows, PANEL))
    reach = np.empty(n)
    bits, largest, orders = 1, 0.0, 0
    for s in range(upper.shape[0]):
        centred = np.hypot(0.5 * decay[s], frequency)
        rate = max(centred / _LONGEST, (centred - 0.5 * decay[s]) / _CANCELLED)
        parts = max(1, int(np.ceil(rate * widths[s])))
        h = widths[s] / parts
        # A multiple of 1/4, so that exp(-shift) undoes exactly what is added to the diagonal.
        shift = np.rint(2.0 * decay[s] * h) * 0.25
        for part in range(parts):
            if stop[0] != 0.0:  # no more time: the caller says so
                return np.nan, orders
            _fill(block, upper[s], part * h, h, shift)
            # The product with a step's length carries its rounding error; at a switch, that of the clock.
            rounded = 1.0 if part > 0 else 1.0 + clock / (_CARRIED * h)
            bits = _round(block, state, reach, shift, rounded, bits)
            peak, count = _add_series(block, terms, state)
            orders += count
            back = np.exp(-shift)
            for i in range(n):
                for q in range(PANEL):
                    state[i, q] *= back
            largest = max(largest, _largest(state), back * peak)
    carried = 0.0
    for i in range(n):
        carried = max(carried, abs(state[i, PANEL - 1]))
    # The tests measure the margin of the factors on random robots in extended precision.
    return 2.220446049250313e-16 * (_CARRIED * carried / _ROUND_OFF + _OWN * largest), orders


@njit
def propagate_all(widths: Any, upper: Any, decay: Any, frequency: float, clock: float, matrix: Any, stop: Any) -> Any:
    """Carry the columns of ``matrix`` (2N+1, 2N+1) through all intervals, in place, panel by panel; see _propagate."""
    n, error, orders = matrix.shape[0], 0.0, 0
    state = np.empty(((n + ROWS - 1) // ROWS * ROWS, PANEL))
    for first in range(0, n, PANEL - 1):
        last = min(first + PANEL - 1, n)
        state[:] = 0.0
        for i in range(n):
            copy_into(state[i, : last - first], matrix[i, first:last])
        e, k = _propagate(widths, upper, decay, frequency, clock, state, stop)
        error = max(error, e)
        orders += k
        for i in range(n):
            copy_into(matrix[i, first:last], state[i])
    return error, orders


@parallel_njit
def propagate_batch(
    widths: Any, upper: Any, decay: Any, frequency: Any, clock: float, matrices: Any, errors: Any, stop: Any
) -> None:
    """:func:`propagate` for many robots with the same gait, on all cores: all but ``widths`` and ``clock`` have robots
    in front."""
    for r in numba.prange(matrices.shape[0]):
        errors[r] = propagate_all(widths, upper[r], decay[r], frequency[r], clock, matrices[r], stop)[0]


def propagate(
    widths: Array, upper: Array, decay: Array, frequency: float, clock: float, matrix: Array
) -> tuple[float, int]:
    """Multiply ``matrix``, shape (2N+1, 2N+1), from the left by the fundamental matrix over all intervals, in place.

    Intervals have widths, s, shape (intervals,), which are rounded to some eps of ``clock``, the largest time that went
    into them; upper rows of A0, A1, A2, shape (intervals, N+2, 3, 2N+1), springs and dampers included; and a fastest
    decay, 1/s, shape (intervals,), which need not be exact, nor need the highest frequency at which the springs ring,
    1/s.

    Returns the bound on the error of the largest entry, and the number of Taylor orders computed.
    """
    n, intervals = len(matrix), widths.size
    if (matrix.shape, upper.shape, decay.size) != ((n, n), (intervals, (n + 3) // 2, 3, n), intervals):
        raise ParameterError("must have the shapes of propagate()", field="upper", value=upper.shape)
    error, orders = propagate_all(widths, upper, decay, frequency, clock, matrix, deadline.stop())
    deadline.check()
    return float(error), int(orders)
