"""Return maps of the straight walks of many robots that may differ in any of their numbers.

A sweep over springs shares the matrices of the rest of the robot (:meth:`PlanarModel.flow_many`). Where every robot has
its own, their assembly in extended precision takes ten times as long as the flow. Here they are sums: the equations are
linear in the contact moments of the modules, and what multiplies these depends on the chain alone, so that it is
computed once for all robots of a chain, and one product of matrices assembles a thousand robots.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from chilopod.compiled import njit
from chilopod.frozen import Array
from chilopod.planar import linear
from chilopod.planar.flow import pieces
from chilopod.planar.model import MOST_WORK, joint_rates

if TYPE_CHECKING:
    from chilopod.gait import Gait
    from chilopod.robot import Robot

_MOST_STEPS = 2e4  # of a return: some seconds
_TERMS = 6  # of a module: c, v c, c x, v c x, c y, c (x^2 + y^2)


def return_maps(robots: Sequence[Robot]) -> tuple[Array, Array]:
    """Return maps of the straight walks of robots that share their :func:`shape`, shape (robots, 2N+1, 2N+1): of half a
    period, mirrored, where the gait has that symmetry, else of a period; and bounds on the errors of their largest
    entries, shape (robots,). Both are NaN where the motion is too fast to follow."""
    first = robots[0]
    n, half = first.body.modules, first.gait.half_period_symmetric
    widths, upper, decay, frequency = _equations(robots, half)
    to_joint, from_joint = joint_rates(n)
    maps, errors = np.full((len(robots), *from_joint.shape), np.nan), np.full(len(robots), np.nan)
    steps = linear.steps(widths, decay, frequency[:, None])
    followed = np.flatnonzero((steps < _MOST_STEPS) & (steps * (2 * n + 1) ** 3 < MOST_WORK))
    clocks, maps[followed] = np.array([robot.gait.period for robot in robots]), from_joint
    _propagate(followed, widths, upper, decay, frequency, clocks, maps, errors)
    maps = to_joint @ maps
    if half:
        maps[:, 1:] *= -1.0
    return maps, 2.0 * errors


def shape(robot: Robot) -> tuple[int, bool, int]:
    """Properties that robots of one call share: number of modules, True if the gait has the half-period
    symmetry, and number of intervals of constant contact in a return."""
    modules, half = robot.body.modules, robot.gait.half_period_symmetric
    return modules, half, len(_contacts(robot.gait, modules, half)[0])


@njit
def _propagate(
    chosen: Any, widths: Any, upper: Any, decay: Any, frequency: Any, clocks: Any, maps: Any, errors: Any
) -> None:
    stop = np.zeros(1)  # never
    for r in chosen:
        errors[r] = linear.propagate_all(widths[r], upper[r], decay[r], frequency[r], clocks[r], maps[r], stop)[0]


def _equations(robots: Sequence[Robot], half: bool) -> tuple[Array, Array, Array, Array]:
    """Widths, upper rows, fastest decay and frequency of the springs, as of :meth:`PlanarModel._linear_pieces`, with
    the robots in front."""
    n = robots[0].body.modules
    contacts = [_contacts(robot.gait, n, half) for robot in robots]
    widths = np.stack([each[0] for each in contacts])
    count, moment, sides, square = (np.stack([each[1][k] for each in contacts]) for k in range(4))
    numbers = [
        (r.legs.forward_offset, r.legs.half_width, r.ground.friction, r.module_mass, r.gait.speed) for r in robots
    ]
    offset, width, friction, mass, v = np.array(numbers).T[..., None, None]
    per_mass = friction / mass
    c, c_x, c_y = per_mass * count, per_mass * (offset * count + moment), per_mass * width * sides
    c_xx = per_mass * ((offset**2 + width**2) * count + 2.0 * offset * moment + square)
    rows = (
        (c, v * c, c_x, v * c_x, c_y, c_xx),
        (0.0, 0.0, -v * c, -(v**2) * c, 0.0, -2.0 * v * c_x),
        (0.0, 0.0, 0.0, 0.0, 0.0, v**2 * c),
    )
    terms = np.stack([np.stack(np.broadcast_arrays(c, *row)[1:], axis=2) for row in rows], axis=2)
    stiffness, damping = (np.array([getattr(r.springs, name) for r in robots]) for name in ("stiffness", "damping"))
    upper = np.empty((len(robots), widths.shape[1], n + 2, 3, 2 * n + 1))
    frequency, decay = np.empty(len(robots)), np.empty(widths.shape)
    chains = [(robot.module_length, robot.module_yaw_inertia / robot.module_mass) for robot in robots]
    keys, chain = np.unique(chains, axis=0, return_inverse=True)
    for number, key in enumerate(keys.tolist()):
        own = np.flatnonzero(chain.ravel() == number)
        passive, joint, rates = _chain(n, *key)
        found = terms[own].reshape(-1, _TERMS * n) @ passive
        there = found.reshape(len(own), -1, 3, n + 2, 2 * n + 1).swapaxes(2, 3).copy()
        there[:, :, 1, 0, 2] -= v[own, :, 0]  # module 1's frame turns: vy' = a_y - w0 vx
        decay[own] = _decay(widths[own], there, v[own, :, 0])
        springs, dampers = ((each[own] / mass[own, :, 0])[:, None, :] for each in (stiffness, damping))
        there[:, :, :, 0, n + 2 :] -= (joint * springs)[:, None]
        there[:, :, :, 0, : n + 2] -= ((joint * dampers) @ rates)[:, None]
        bound = np.abs(rates @ joint)
        frequency[own] = np.sqrt((springs @ bound.T).max(axis=(1, 2)))
        decay[own] += (dampers @ bound.T).max(axis=(1, 2))[:, None]
        upper[own] = there
    return widths, upper, decay, frequency


def _decay(widths: Array, upper: Array, speeds: Array) -> Array:
    """Upper bound on the fastest decay by the feet in every interval, see :func:`linear.system_matrices`: the eighth
    root of the sum of the eighth powers of all decays, which no eigenvalue exceeds."""
    h, velocities = widths[..., None, None], upper[..., : upper.shape[2]]
    a0, a1, a2 = (velocities[:, :, :, power] for power in range(3))
    drags = np.stack([a0, a0 + h * (a1 + h * a2), a0 - h * (a1 / 2.0 - h * a2 / 3.0)])
    drags[..., 1, 2] += speeds
    fourth = np.linalg.matrix_power(drags, 4)
    powers: Array = np.einsum("...ij,...ji", fourth, fourth).max(0) ** 0.125
    return powers


@lru_cache(maxsize=512)
def _contacts(gait: Gait, modules: int, half: bool) -> tuple[Array, Array]:
    """Widths of the intervals of a return, s, shape (intervals,); and over the standing feet of every module the sums
    of 1, of the stroke (m), of 1 left and -1 right, and of the stroke's square (m^2), shape (4, intervals, N)."""
    _, widths, interval = pieces(gait, modules, 0.0, 0.5 * gait.period if half else gait.period)
    schedule = gait.schedule(modules)
    contact, stroke = schedule.contact[interval].astype(np.float64), schedule.stroke[interval]
    sums = (contact, contact * stroke, contact * [1.0, -1.0], contact * stroke**2)
    return widths, np.stack([each.sum(-1) for each in sums])


@lru_cache(maxsize=512)
def _chain(modules: int, length: float, inertia: float) -> tuple[Array, Array, Array]:
    """Accelerations of a chain of modules of unit mass (length in m, yaw inertia in m^2) by a unit of each term of each
    module, shape (6 N, (N+2) (2N+1)); by a unit torque at a joint, shape (N+2, N-1); and the joint rates as functions
    of the velocities, shape (N-1, N+2)."""
    n = modules
    extended: Any = np.longdouble if n <= linear.MOST_EXTENDED else np.float64
    matrix, lateral = linear.mass_matrix(n, length, 1.0, inertia, extended)
    heading = np.tril(np.ones((n, n - 1), extended), -1)
    force = np.zeros((_TERMS, n, n + 2, 2 * n + 1), extended)
    one, turns = np.eye(n + 2, dtype=extended)[0], np.eye(n + 2, dtype=extended)[2:]
    for i in range(n):
        across = lateral[i]
        force[0, i, :, : n + 2] = -np.outer(across, across) - np.outer(one, one)
        force[1, i, :, n + 2 :] = np.outer(across, heading[i])
        force[2, i, :, : n + 2] = -np.outer(across, turns[i]) - np.outer(turns[i], across)
        force[3, i, :, n + 2 :] = np.outer(turns[i], heading[i])
        force[4, i, :, : n + 2] = np.outer(one, turns[i]) + np.outer(turns[i], one)
        force[5, i, :, : n + 2] = -np.outer(turns[i], turns[i])
    rates = linear.rate_differences(n)
    columns = np.moveaxis(force, 2, 0).reshape(n + 2, -1)
    solved = linear.solve(matrix, np.concatenate([columns, rates.T], axis=1))
    passive = solved[:, : columns.shape[1]].reshape(n + 2, _TERMS * n, 2 * n + 1).swapaxes(0, 1)
    return passive.reshape(_TERMS * n, -1).copy(), solved[:, columns.shape[1] :].copy(), rates
