"""Ordering of the operations of a graph into a tape."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.graph import LEAVES, Graph
from chilopod.flows.tracing.tape import Tape
from chilopod.frozen import read_only

Terms = dict[int, list[tuple[int, int]]]
"""Weight and node of every term of the sums."""


def ordered(graph: Graph, slopes: Sequence[int], guards: Sequence[int], resets: Sequence[Sequence[int]]) -> Tape:
    """The tape of the operations that some results need: dx/dt, the guards and the resets of events."""
    ends = [*slopes, *guards, *(node for reset in resets for node in reset)]
    flat = _flattened(graph, ends)
    flow = set(_reached(graph, [*slopes, *guards], flat))
    every = _reached(graph, ends, flat)
    numbers = [i for i in every if graph.nodes[i][0] == ops.NUMBER]
    operations = [i for i in every if graph.nodes[i][0] not in LEAVES]
    constant = [i for i in operations if graph.depends[i] == ops.CONSTANT]
    moving = [i for i in operations if graph.depends[i] != ops.CONSTANT and i in flow]
    later = [i for i in operations if graph.depends[i] != ops.CONSTANT and i not in flow]
    order = [*graph.states, graph.time, *graph.parameters, *numbers, *constant, *moving, *later]
    place = {node: i for i, node in enumerate(order)}
    live = _live(graph, ends, every, flat)
    linear = _linear_in_time(graph, every, flat)
    program = np.zeros((6, len(order)), dtype=np.int64)
    terms: list[tuple[int, int]] = []
    switches: list[tuple[int, int, int]] = []
    for i, node in enumerate(order):
        code, operands = graph.nodes[node]
        program[0, i] = code
        program[4, i], program[5, i] = node in live, node in linear
        if code == ops.LINEAR:
            program[1, i] = len(terms)
            terms += [(place[weight], place[term]) for weight, term in flat[node]]
            program[2, i] = len(terms)
        elif code in (ops.STEP, ops.FLOOR):
            program[1, i], program[2, i] = place[operands[0]], -1
            if node in flow and graph.depends[node] != ops.CONSTANT:
                program[2, i] = len(switches)
                switches.append((code, place[operands[0]], i))
        elif code not in LEAVES:
            program[1 : 1 + len(operands), i] = [place[operand] for operand in operands]
            if node in graph.weights and graph.depends[node] != ops.CONSTANT:
                program[3, i] = place[graph.weights[node]]
    switches += [(ops.GUARD, place[guard], k) for k, guard in enumerate(guards)]
    first, stop = len(order) - len(constant) - len(moving) - len(later), len(order) - len(later)
    layout = [len(graph.states), len(graph.parameters), first, first + len(constant), stop, len(order)]
    parts: tuple[Any, ...] = (
        program,
        np.array(terms, dtype=np.int64).reshape(-1, 2).T,
        np.array([graph.value(i) for i in numbers], dtype=np.float64),
        np.array(layout, dtype=np.int64),
        np.array([place[i] for i in slopes], dtype=np.int64),
        np.array(switches, dtype=np.int64).reshape(-1, 3).T,
        np.array([[place[i] for i in reset] for reset in resets], dtype=np.int64).reshape(-1, len(slopes)),
        np.array([place[i] for i in _clocks(graph, every, flat, linear)], dtype=np.int64),
    )
    return Tape(*(read_only(np.ascontiguousarray(part)) for part in parts))


def _operands(graph: Graph, node: int, flat: Terms) -> list[int]:
    if node in flat:
        return [i for term in flat[node] for i in term]
    code, operands = graph.nodes[node]
    return [] if code in LEAVES else list(operands)


def _needed(graph: Graph, node: int, flat: Terms) -> list[int]:
    """Operands of a node, and the w of a function."""
    weight = [graph.weights[node]] if node in graph.weights and graph.depends[node] != ops.CONSTANT else []
    return _operands(graph, node, flat) + weight


def _reached(graph: Graph, roots: Sequence[int], flat: Terms) -> list[int]:
    """All nodes that some nodes need, in order of creation: each after its operands."""
    seen: set[int] = set()
    ahead = list(roots)
    while ahead:
        node = ahead.pop()
        if node in seen:
            continue
        seen.add(node)
        ahead += _needed(graph, node, flat)
    return sorted(seen)


def _flattened(graph: Graph, roots: Sequence[int]) -> Terms:
    """The terms of the sums; a sum that only one other sum uses is merged into it."""
    reached = _reached(graph, roots, {})
    uses = Counter(roots)
    for node in reached:
        uses.update(_needed(graph, node, {}))
    flat: Terms = {}
    for node in reached:
        if graph.nodes[node][0] != ops.LINEAR:
            continue
        flat[node] = []
        for weight, term in graph.terms(node):
            if graph.nodes[term][0] == ops.LINEAR and uses[term] == 1 and graph.depends[term] != ops.CONSTANT:
                flat[node] += [(graph.multiply(weight, inner), part) for inner, part in flat[term]]
            else:
                flat[node].append((weight, term))
    # Weights made here may be sums themselves.
    for node in _reached(graph, [weight for terms in flat.values() for weight, _ in terms], flat):
        if graph.nodes[node][0] == ops.LINEAR and node not in flat:
            flat[node] = graph.terms(node)
    return flat


def _live(graph: Graph, roots: Sequence[int], every: Sequence[int], flat: Terms) -> set[int]:
    """The nodes whose tangents are needed; those used only as the w of a function need none."""
    surfaces = [graph.nodes[i][1][0] for i in every if graph.nodes[i][0] in (ops.STEP, ops.FLOOR)]
    ahead, live = [*roots, *surfaces], set[int]()
    while ahead:
        node = ahead.pop()
        if node in live or graph.depends[node] != ops.MOVING or graph.nodes[node][0] in (ops.STEP, ops.FLOOR):
            continue
        live.add(node)
        ahead += _operands(graph, node, flat)
    return live


def _linear_in_time(graph: Graph, every: Sequence[int], flat: Terms) -> set[int]:
    linear = {graph.time}
    for node in every:
        if node in flat and all(graph.depends[term] == ops.CONSTANT or term in linear for _, term in flat[node]):
            linear.add(node)
    return linear


def _clocks(graph: Graph, every: Sequence[int], flat: Terms, linear: set[int]) -> list[int]:
    plain: set[int] = set()  # functions that a Taylor series resolves everywhere
    for node in every:
        code, operands = graph.nodes[node]
        if code == ops.TIME:
            plain.add(node)
        elif graph.depends[node] == ops.TIMED:
            parts = _operands(graph, node, flat)
            if code in (ops.LINEAR, ops.PRODUCT, ops.SQUARE, ops.SELECT):
                simple = all(part in plain or graph.depends[part] == ops.CONSTANT for part in parts)
            elif code in (ops.SIN, ops.COS):
                simple = operands[0] in linear
            else:
                simple = code in (ops.STEP, ops.FLOOR) and operands[0] in plain
            if simple:
                plain.add(node)
    # Sums and products of these add no features, but a large constant may hide a small tail.
    combined = (ops.LINEAR, ops.PRODUCT, ops.SQUARE, ops.SELECT, ops.STEP, ops.FLOOR)
    return [i for i in every if graph.depends[i] == ops.TIMED and i not in plain and graph.nodes[i][0] not in combined]
