"""Branches of switches, and motions through a switch or an event, for :mod:`.stepping`.

Along a step every switch stays on its branch: 1 or -1, the sign of its switching function, or of a ``FLOOR`` the whole
number. At the start of an interval :func:`settle` chooses the branches, and :func:`await_events` those of guards that
are zero there. Where a step ends at a switch, :func:`cross` changes its branch, applies the reset of an event and finds
the jump of the derivative.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from chilopod.compiled import fused_njit
from chilopod.flows.carrying import DONE, GRAZES, JUMPS, SLIDES
from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.series import Series, branch_at, choose, expand, expand_values, loaded, values_between

_ZERO = 1e-13  # size of a switching function, relative to its earlier values, that counts as zero


class Motion(NamedTuple):
    """A state along a motion, and its series there."""

    x: Any  # state, shape (n,)
    seeds: Any  # directions of the tangents, shape (n, columns)
    series: Any  # series of all nodes from the state
    scales: Any  # largest value of every switching function so far, shape (switches,)


@fused_njit(error_model="numpy", inline="always")
def start(tape: Any, motion: Any, t: float) -> None:
    """Set the state and the time from which a series starts; the tangents are those along the columns of ``seeds``."""
    n = tape.layout[0]
    values, tangents, seeds = motion.series.values, motion.series.tangents, motion.seeds
    for i in range(n):
        values[i, 0] = motion.x[i]
        for lane in range(tangents.shape[2]):
            tangents[i, 0, lane] = seeds[i, lane] if lane < seeds.shape[1] else 0.0
    values[n, 0] = t


@fused_njit(error_model="numpy")
def settle(tape: Any, motion: Any, unit: float) -> int:
    """Choose the branch of every switch at a state; where its function is zero, by the sign that it is about to have.
    If f on that branch pushes it back, the motion slides along the switching surface."""
    switches = tape.switches
    values, branches, scales = motion.series.values, motion.series.branches, motion.scales
    choose(tape, motion.series)
    for _ in range(2):
        expand_values(tape, 1, tape.layout[4], unit, motion.series)
        settled = True
        for s in range(switches.shape[1]):
            g, slope = values[switches[1, s], 0], values[switches[1, s], 1]
            if switches[0, s] == ops.FLOOR:
                if g == branches[s] and slope < 0.0:
                    branches[s] -= 1.0
                    settled = False
            elif abs(g) <= _ZERO * scales[s] and slope * branches[s] < 0.0:
                branches[s] = -branches[s]
                settled = False
        if settled:
            return DONE
    # The branch changed twice: f points to the switching surface on both sides.
    for s in range(switches.shape[1]):
        g = values[switches[1, s], 0]
        if switches[0, s] != ops.GUARD and abs(g) <= _ZERO * scales[s]:
            return SLIDES
    return DONE


@fused_njit(error_model="numpy", inline="always")
def enlarge_scales(tape: Any, motion: Any, order: int, h: float) -> None:
    """Keep the largest values of the switching functions."""
    for s in range(tape.switches.shape[1]):
        power = 1.0
        for k in range(order + 1):
            motion.scales[s] = max(motion.scales[s], abs(motion.series.values[tape.switches[1, s], k]) * power)
            power *= h


@fused_njit(error_model="numpy")
def departure(tape: Any, params: Any, x: Any, soon: float) -> Any:
    """dx/dt at a state at time 0, on the branches that the motion has once it passed the surfaces that it meets within
    a time ``soon``."""
    switches = tape.switches
    series = loaded(tape, params, 2, 0, np.zeros(switches.shape[1]))
    motion = Motion(x, np.empty((x.size, 0)), series, np.zeros(switches.shape[1]))
    start(tape, motion, 0.0)
    choose(tape, series)
    expand_values(tape, 1, tape.layout[4], 1.0, series)
    for s in range(switches.shape[1]):
        motion.scales[s] = soon * abs(series.values[switches[1, s], 1]) / _ZERO
    settle(tape, motion, 1.0)
    return series.values[: x.size, 1].copy()


@fused_njit(error_model="numpy")
def is_timed(tape: Any, s: int) -> bool:
    """True if a switch is a guard that depends on time only."""
    return bool(tape.switches[0, s] == ops.GUARD and tape.program[4, tape.switches[1, s]] == 0)


@fused_njit(error_model="numpy")
def cross(tape: Any, directions: Any, motion: Any, s: int, direction: float, unit: float, t: float, jump: Any) -> int:
    """Pass a switch or an event: the state after it in ``x``, its derivative times ``seeds`` in ``jump``.

    With reset r and guard g, the derivative is Dr + (f+ - Dr f-) grad g / (grad g . f-), f- and f+ before and after
    (the saltation matrix; Dr f- is ``before``, grad g . f- is ``slope``, grad g times the seeds ``gradient``).
    """
    n, switches = tape.layout[0], tape.switches
    values, tangents, branches = motion.series.values, motion.series.tangents, motion.series.branches
    g, is_guard = switches[1, s], switches[0, s] == ops.GUARD
    event = switches[2, s] if is_guard and directions[switches[2, s]] * direction >= 0.0 else -1
    start(tape, motion, t)
    expand(tape, 1, tape.layout[5] if event >= 0 else tape.layout[4], unit, motion.series)
    slope, gradient, surfaces = values[g, 1], tangents[g, 0].copy(), values[switches[1], 0]
    before, moves = np.empty(n), False
    for i in range(n):
        node = tape.resets[event, i] if event >= 0 else i
        moves = moves or node != i
        motion.x[i] = values[node, 0]
        before[i] = values[node, 1]
        for j in range(jump.shape[1]):
            jump[i, j] = tangents[node, 0, j]
    branches[s] = branches[s] + direction if switches[0, s] == ops.FLOOR else direction
    start(tape, motion, t)
    if moves:
        status = settle(tape, motion, unit)
    elif is_guard:
        return DONE  # f does not switch here
    else:
        status = _carry_over(tape, directions, motion, s, surfaces)
    if status != DONE:
        return status
    expand_values(tape, 1, tape.layout[4], unit, motion.series)
    if not moves and values[g, 1] * direction < 0.0:
        return SLIDES
    if gradient.any() and (values[:n, 1] != before).any():
        if slope * direction <= 0.0:
            return GRAZES
        for i in range(n):
            f = (values[i, 1] - before[i]) / slope
            for j in range(jump.shape[1]):
                jump[i, j] += f * gradient[j]
    return DONE


@fused_njit(error_model="numpy")
def _carry_over(tape: Any, directions: Any, motion: Any, switched: int, surfaces: Any) -> int:
    """Update the branches of switches whose own functions jump with another switch; a guard's must not pass zero."""
    switches, values, branches, first = tape.switches, motion.series.values, motion.series.branches, tape.layout[3]
    for s in range(switches.shape[1]):
        is_guard = switches[0, s] == ops.GUARD
        stop = tape.layout[4] if is_guard else switches[2, s]
        values_between(tape, motion.series, first, stop)
        first = stop
        g = values[switches[1, s], 0]
        if s != switched and abs(g - surfaces[s]) > _ZERO * motion.scales[s]:
            before = branches[s]
            branches[s] = branch_at(switches[0, s], g)
            turn = branches[s] - before
            if is_guard and turn != 0.0 and turn * directions[switches[2, s]] >= 0.0:
                return JUMPS
    values_between(tape, motion.series, first, tape.layout[4])
    return DONE


@fused_njit(error_model="numpy")
def await_events(tape: Any, directions: Any, motion: Any, unit: float, soon: float, t: float) -> None:
    """Set the guards that pass zero within a time ``soon`` of the start of an interval to before the event if it is
    still to come, else to after it.

    Events of guards that depend on time only are still to come: an event at the border of two intervals belongs to the
    second. A state on a guard that is about to fire is before the event if the reset makes it move away (an impact);
    else, as where legs change places, it counts as the state after the event.
    """
    switches, series, scales = tape.switches, motion.series, motion.scales
    for s in range(switches.shape[1]):
        if switches[0, s] != ops.GUARD:
            continue
        value, slope = series.values[switches[1, s], 0], series.values[switches[1, s], 1]
        scales[s] = soon * abs(slope) / _ZERO  # `settle` takes a guard this near zero for zero
        if not (slope != 0.0 and abs(value) <= soon * abs(slope)):
            continue
        direction = 1.0 if slope > 0.0 else -1.0
        ahead = is_timed(tape, s)
        if not ahead and directions[switches[2, s]] * direction > 0.0:
            # Try the event: does the guard run back after the reset? State and branches are copies, the series is not.
            then = Series(series.values, series.tangents, series.branches.copy())
            after = Motion(motion.x.copy(), motion.seeds, then, scales)
            cross(tape, directions, after, s, direction, unit, t, np.empty(motion.seeds.shape))
            ahead = series.values[switches[1, s], 1] * direction < 0.0
            start(tape, motion, t)  # expand the series at the start again
            settle(tape, Motion(motion.x, motion.seeds, then, scales), unit)
        series.branches[s] = -direction if ahead else direction
