"""Order of the operations of a graph in a tape.

The graph numbers its nodes as they were made, and keeps some that no result needs. Here

1. a sum that only one other sum uses is merged into it;
2. the nodes that the results need are collected, from the results backwards;
3. these are put into the order of a tape: leaves, constants, operations of f and the guards, those of the resets;
4. the tables of the tape are filled with the places of the nodes in this order.

``operands`` and ``needs`` are lists with an entry for every node of the graph.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.graph import LEAVES, Graph
from chilopod.flows.tracing.tape import Integers, Tape
from chilopod.frozen import read_only

_SWITCHES = ops.STEP, ops.FLOOR
_COMBINING = (ops.LINEAR, ops.PRODUCT, ops.SQUARE, ops.SELECT, *_SWITCHES)

Operands = list[tuple[int, ...]]
"""Operands of every node: of a sum weight and node of each term in turn, of a leaf none."""


def ordered(graph: Graph, slopes: Sequence[int], guards: Sequence[int], resets: Sequence[Sequence[int]]) -> Tape:
    """The tape of the operations that some results need: dx/dt, the guards and the resets of events."""
    ends = [*slopes, *guards, *(node for reset in resets for node in reset)]
    operands = _merged(graph, ends)
    needs = _with_weights(graph, operands)
    every, flow = _reached(ends, needs), set(_reached([*slopes, *guards], needs))
    numbers = [i for i in every if graph.nodes[i][0] == ops.NUMBER]
    operations = [i for i in every if graph.nodes[i][0] not in LEAVES]
    constant = [i for i in operations if graph.depends[i] == ops.CONSTANT]
    moving = [i for i in operations if graph.depends[i] != ops.CONSTANT and i in flow]
    later = [i for i in operations if graph.depends[i] != ops.CONSTANT and i not in flow]
    order = [*graph.states, graph.time, *graph.parameters, *numbers, *constant, *moving, *later]
    place = {node: i for i, node in enumerate(order)}
    first, stop = len(order) - len(operations), len(order) - len(later)
    linear, live = _linear_in_time(graph, every, operands), _with_tangents(graph, ends, every, operands)
    program, terms = _program(graph, place, operands)
    program[4], program[5] = [node in live for node in order], [node in linear for node in order]
    switches = [(graph.nodes[i][0], place[operands[i][0]], place[i]) for i in moving if graph.nodes[i][0] in _SWITCHES]
    for s, (_, _, i) in enumerate(switches):
        program[2, i] = s
    switches += [(ops.GUARD, place[guard], k) for k, guard in enumerate(guards)]
    parts: tuple[Any, ...] = (
        program,
        np.array(terms, dtype=np.int64).reshape(-1, 2).T,
        np.array([graph.value(i) for i in numbers], dtype=np.float64),
        np.array([len(graph.states), len(graph.parameters), first, first + len(constant), stop, len(order)]),
        np.array([place[i] for i in slopes], dtype=np.int64),
        np.array(switches, dtype=np.int64).reshape(-1, 3).T,
        np.array([[place[i] for i in reset] for reset in resets], dtype=np.int64).reshape(-1, len(slopes)),
        np.array([place[i] for i in _clocks(graph, every, operands, linear)], dtype=np.int64),
    )
    return Tape(*(read_only(np.ascontiguousarray(part)) for part in parts))


def _merged(graph: Graph, ends: Sequence[int]) -> Operands:
    """Operands of every node, where a sum that only one other sum uses is merged into it."""
    needs = _with_weights(graph, _operands(graph))
    needed = _reached(ends, needs)
    uses = Counter([*ends, *(i for node in needed for i in needs[node])])
    sums: dict[int, list[int]] = {}
    for node in needed:
        if graph.nodes[node][0] != ops.LINEAR:
            continue
        sums[node] = []
        for weight, term in graph.terms(node):
            if term in sums and uses[term] == 1 and graph.depends[term] != ops.CONSTANT:
                inner = zip(sums[term][::2], sums[term][1::2], strict=True)
                sums[node] += [i for factor, part in inner for i in (graph.multiply(weight, factor), part)]
            else:
                sums[node] += weight, term
    # The products of weights are new nodes.
    return [tuple(sums.get(node, each)) for node, each in enumerate(_operands(graph))]


def _operands(graph: Graph) -> Operands:
    return [() if code in LEAVES else operands for code, operands in graph.nodes]


def _with_weights(graph: Graph, operands: Operands) -> Operands:
    """Operands of every node, and the w of a function."""
    return [(*each, *_weight(graph, node)) for node, each in enumerate(operands)]


def _weight(graph: Graph, node: int) -> tuple[int, ...]:
    """The w of a function that is not constant; nothing for any other node."""
    return (graph.weights[node],) if node in graph.weights and graph.depends[node] != ops.CONSTANT else ()


def _reached(ends: Sequence[int], needs: Operands) -> list[int]:
    """All nodes that some nodes need, in order of creation: each after its operands."""
    seen: set[int] = set()
    ahead = list(ends)
    while ahead:
        node = ahead.pop()
        if node not in seen:
            seen.add(node)
            ahead += needs[node]
    return sorted(seen)


def _program(graph: Graph, place: dict[int, int], operands: Operands) -> tuple[Integers, list[tuple[int, int]]]:
    """The operations with their operands as in a tape, and the terms of the sums."""
    program = np.zeros((6, len(place)), dtype=np.int64)
    terms: list[tuple[int, int]] = []
    for node, i in place.items():
        code, places = graph.nodes[node][0], [place[operand] for operand in operands[node]]
        if code == ops.LINEAR:
            start = len(terms)
            terms += zip(places[::2], places[1::2], strict=True)
            places = [start, len(terms)]
        elif code in _SWITCHES:
            places.append(-1)
        program[0, i] = code
        program[1 : 1 + len(places), i] = places
        for weight in _weight(graph, node):
            program[3, i] = place[weight]
    return program, terms


def _with_tangents(graph: Graph, ends: Sequence[int], every: Sequence[int], operands: Operands) -> set[int]:
    """The nodes whose tangents are needed; those used only as the w of a function need none."""
    kinds = [code for code, _ in graph.nodes]
    moves = [graph.depends[i] == ops.MOVING and kind not in _SWITCHES for i, kind in enumerate(kinds)]
    surfaces = [operands[i][0] for i in every if kinds[i] in _SWITCHES]
    needs = [each if moves[i] else () for i, each in enumerate(operands)]
    return {node for node in _reached([*ends, *surfaces], needs) if moves[node]}


def _linear_in_time(graph: Graph, every: Sequence[int], operands: Operands) -> set[int]:
    """The nodes a + b t with constants a and b."""
    linear = {node for node in every if graph.depends[node] == ops.CONSTANT} | {graph.time}
    for node in every:
        if graph.nodes[node][0] == ops.LINEAR and linear.issuperset(operands[node][1::2]):
            linear.add(node)
    return linear


def _clocks(graph: Graph, every: Sequence[int], operands: Operands, linear: set[int]) -> list[int]:
    """The functions of time alone that may have features which a Taylor series misses.

    Sums and products of these add no features, but a large constant may hide a small tail.
    """
    plain, clocks = set(linear), []  # functions that a Taylor series resolves everywhere, and others
    for node in every:
        code = graph.nodes[node][0]
        if graph.depends[node] != ops.TIMED or node in plain:
            continue
        known = plain if code in _COMBINING else linear if code in (ops.SIN, ops.COS) else set[int]()
        if known.issuperset(operands[node]):
            plain.add(node)
        elif code not in _COMBINING:
            clocks.append(node)
    return clocks
