"""Which branch a switch is on, and how a motion goes through a switch or an event."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from chilopod.compiled import fused_njit
from chilopod.stability.taylor import tape as ops
from chilopod.stability.taylor.series import expand, values_at

STEP, FLOOR, GUARD = ops.STEP, ops.FLOOR, ops.GUARD

DONE, NOT_FINITE, BUDGET, STALLED, SLIDES, CHATTERS, GRAZES = range(7)
"""How an integration ends."""

_ZERO = 1e-13
"""A switching function this small, relative to what it was before, is zero."""


@fused_njit(error_model="numpy")
def settle(
    program: Any,
    terms: Any,
    layout: Any,
    slopes: Any,
    switches: Any,
    unit: float,
    values: Any,
    tangents: Any,
    branches: Any,
    scales: Any,
) -> int:
    """Choose the branch of every switch at a state; where its function is zero, by where that goes."""
    for i in range(layout[3], layout[4]):
        if program[0, i] == STEP:
            branches[program[2, i]] = 1.0 if values[program[1, i], 0] >= 0.0 else -1.0
        elif program[0, i] == FLOOR:
            branches[program[2, i]] = math.floor(values[program[1, i], 0])
        values_at(program, terms, i, i + 1, 0, values, branches)
    for s in range(switches.shape[1]):
        if switches[0, s] == GUARD:
            branches[s] = 1.0 if values[switches[1, s], 0] >= 0.0 else -1.0
    nothing = tangents[:, :, :0]
    for _ in range(2):
        expand(program, terms, layout, slopes, 1, values, nothing, branches, layout[4], unit)
        settled = True
        for s in range(switches.shape[1]):
            g = values[switches[1, s], 0]
            slope = values[switches[1, s], 1]
            if switches[0, s] == FLOOR:
                if g == branches[s] and slope < 0.0:
                    branches[s] -= 1.0
                    settled = False
            elif abs(g) <= _ZERO * scales[s] and slope * branches[s] < 0.0:
                branches[s] = -branches[s]
                settled = False
        if settled:
            return DONE
    # Changed twice: f points to the switching surface on both sides.
    for s in range(switches.shape[1]):
        g = values[switches[1, s], 0]
        if switches[0, s] != GUARD and abs(g) <= _ZERO * scales[s]:
            return SLIDES
    return DONE


@fused_njit(error_model="numpy")
def is_timed(program: Any, switches: Any, s: int) -> bool:
    """Whether a switch is a guard that knows only time."""
    return bool(switches[0, s] == GUARD and program[4, switches[1, s]] == 0)


@fused_njit(error_model="numpy")
def start(layout: Any, x: Any, t: float, seeds: Any, values: Any, tangents: Any) -> None:
    """Set the state and the time from which a series starts; the tangents are those along the columns of ``seeds``."""
    n = layout[0]
    for i in range(n):
        values[i, 0] = x[i]
        for lane in range(tangents.shape[2]):
            tangents[i, 0, lane] = seeds[i, lane] if lane < seeds.shape[1] else 0.0
    values[n, 0] = t


@fused_njit(error_model="numpy")
def _carry_over(
    program: Any,
    terms: Any,
    layout: Any,
    switches: Any,
    switched: int,
    surfaces: Any,
    values: Any,
    branches: Any,
    scales: Any,
) -> None:
    """Choose anew the branches of the switches whose own functions jump where another one switches."""
    for i in range(layout[3], layout[4]):
        if program[0, i] == STEP or program[0, i] == FLOOR:
            s = program[2, i]
            g = values[program[1, i], 0]
            if s != switched and abs(g - surfaces[s]) > _ZERO * scales[s]:
                if program[0, i] == FLOOR:
                    branches[s] = math.floor(g)
                else:
                    branches[s] = 1.0 if g >= 0.0 else -1.0
        values_at(program, terms, i, i + 1, 0, values, branches)
    for s in range(switches.shape[1]):
        g = values[switches[1, s], 0]
        if switches[0, s] == GUARD and abs(g - surfaces[s]) > _ZERO * scales[s]:
            branches[s] = 1.0 if g >= 0.0 else -1.0


@fused_njit(error_model="numpy")
def cross(
    program: Any,
    terms: Any,
    layout: Any,
    slopes: Any,
    switches: Any,
    resets: Any,
    directions: Any,
    s: int,
    direction: float,
    unit: float,
    x: Any,
    t: float,
    seeds: Any,
    values: Any,
    tangents: Any,
    branches: Any,
    scales: Any,
    jump: Any,
) -> tuple[int, int]:
    """Go through a switch or an event: the state after it in ``x``, its derivative times ``seeds`` in ``jump``.

    Returns the status, and the number of the event or -1.
    """
    n = layout[0]
    g = switches[1, s]
    event = -1
    if switches[0, s] == GUARD and directions[switches[2, s]] * direction >= 0.0:
        event = switches[2, s]
    start(layout, x, t, seeds, values, tangents)
    expand(
        program,
        terms,
        layout,
        slopes,
        1,
        values,
        tangents,
        branches,
        layout[5] if event >= 0 else layout[4],
        unit,
    )
    slope = values[g, 1]
    gradient = tangents[g, 0].copy()
    surfaces = values[switches[1], 0]
    before = np.empty(n)
    for i in range(n):
        before[i] = values[i, 1]
        for j in range(seeds.shape[1]):
            jump[i, j] = seeds[i, j]
    if switches[0, s] == FLOOR:
        branches[s] += direction
    else:
        branches[s] = direction
    moves = False
    if event >= 0:
        for i in range(n):
            node = resets[event, i]
            if node != i:
                moves = True
            x[i] = values[node, 0]
            before[i] = values[node, 1]
            for j in range(seeds.shape[1]):
                jump[i, j] = tangents[node, 0, j]
    start(layout, x, t, seeds, values, tangents)
    if moves:
        status = settle(program, terms, layout, slopes, switches, unit, values, tangents, branches, scales)
        if status != DONE:
            return status, event
    elif switches[0, s] == GUARD:
        return DONE, event  # f does not switch here
    else:
        _carry_over(program, terms, layout, switches, s, surfaces, values, branches, scales)
    nothing = tangents[:, :, :0]
    expand(program, terms, layout, slopes, 1, values, nothing, branches, layout[4], unit)
    if not moves and values[g, 1] * direction < 0.0:
        return SLIDES, event
    steepest = 0.0
    for j in range(gradient.size):
        steepest = max(steepest, abs(gradient[j]))
    if steepest > 0.0:
        differs = False
        for i in range(n):
            if values[i, 1] != before[i]:
                differs = True
        if differs and slope * direction <= 0.0:
            return GRAZES, event
        if differs:
            for i in range(n):
                f = (values[i, 1] - before[i]) / slope
                for j in range(seeds.shape[1]):
                    jump[i, j] += f * gradient[j]
    return DONE, event


@fused_njit(error_model="numpy")
def await_events(
    program: Any,
    terms: Any,
    layout: Any,
    slopes: Any,
    switches: Any,
    resets: Any,
    directions: Any,
    unit: float,
    soon: float,
    x: Any,
    t: float,
    seeds: Any,
    values: Any,
    tangents: Any,
    branches: Any,
    scales: Any,
) -> None:
    """Set the guards that pass zero within a time ``soon`` of the start of an interval to before it, if the event is
    still to come, else to after it.

    That is so of guards that know only time: an event at the border of two intervals belongs to the second. A state on
    a guard that moves as if to fire is one before the event if the event leaves it moving away (an impact); else, as
    where legs change places, it may as well be the state after it, and is taken for that.
    """
    for s in range(switches.shape[1]):
        if switches[0, s] != GUARD:
            continue
        value, slope = values[switches[1, s], 0], values[switches[1, s], 1]
        scales[s] = soon * abs(slope) / _ZERO
        if not (slope != 0.0 and abs(value) <= soon * abs(slope)):
            continue
        direction = 1.0 if slope > 0.0 else -1.0
        ahead = is_timed(program, switches, s)
        if not ahead and directions[switches[2, s]] * direction > 0.0:
            after, then, jump = x.copy(), branches.copy(), np.empty(seeds.shape)
            cross(
                program,
                terms,
                layout,
                slopes,
                switches,
                resets,
                directions,
                s,
                direction,
                unit,
                after,
                t,
                seeds,
                values,
                tangents,
                then,
                scales,
                jump,
            )
            ahead = values[switches[1, s], 1] * direction < 0.0
            start(layout, x, t, seeds, values, tangents)
            settle(program, terms, layout, slopes, switches, unit, values, tangents, then, scales)
        branches[s] = -direction if ahead else direction
