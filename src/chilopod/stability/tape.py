"""A right-hand side as data: the list of the elementary operations that evaluate it.

A :class:`Graph` collects operations while a function is traced (:mod:`chilopod.stability.tracing`), shares common
subexpressions and folds constants; :meth:`Graph.tape` orders them into a :class:`Tape`. The operations are those whose
Taylor coefficients obey a recurrence (Griewank and Walther, *Evaluating Derivatives*, 2nd ed., SIAM 2008, sec. 13.2):

* ``LINEAR``: a sum of nodes with constant weights, ``PRODUCT``, ``SQUARE``, ``QUOTIENT``;
* functions c = phi(a) with c' = w a', where w is another node of the tape: sin, cos, exp, ... ;
* ``STEP`` (the sign of its operand) and ``FLOOR``, constant along a step of the integration and the only places where
  a right-hand side or its derivatives may jump, and ``SELECT``, one of two nodes by a ``STEP``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import ReadOnlyArrays

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

STATE, TIME, PARAMETER, NUMBER = 0, 1, 2, 3
LINEAR, PRODUCT, SQUARE, QUOTIENT = 4, 5, 6, 7
STEP, FLOOR, SELECT = 8, 9, 10
EXP, SIN, COS, TAN, SINH, COSH, TANH, LOG, SQRT, POWER, ATAN, ASIN = range(11, 23)

GUARD = 23
"""As a kind of switch: the guard of an event."""

CONSTANT, TIMED, MOVING = 0, 1, 2
"""What a node depends on: parameters only, time too, or the state."""


@dataclass(frozen=True)
class Tape(ReadOnlyArrays):
    """The operations that evaluate dx/dt = f(t, x), the guards g_k(t, x) and resets r_k(t, x) of its events.

    Nodes are numbered: n states, time, parameters, numbers, then operations, each after its operands: those that depend
    on the parameters only, those of f and the guards, those of the resets.

    Attributes
    ----------
    program
        Shape (5, nodes): operation, its three operands (of ``LINEAR`` the first and past-last of its terms; of ``STEP``
        and ``FLOOR`` the second is the number of the switch; of functions the third is w), and whether tangents of the
        node are needed.
    terms
        Shape (2, terms): weight and node of each term of the ``LINEAR`` operations.
    numbers
        Values of the number nodes.
    layout
        n, number of parameters, first operation, first that is not constant, first of the resets, number of nodes.
    slopes
        Nodes of f, shape (n,).
    switches
        Shape (3, switches): kind (``STEP``, ``FLOOR`` or ``GUARD``), node of the switching function, and for guards the
        number of the event, else the node of the switch.
    resets
        Nodes of the resets, shape (events, n).
    clocks
        Nodes that depend on time only and are more than a polynomial in t, cos(a t), sin(a t): these may hold pulses
        that a Taylor series does not see.
    """

    program: Integers
    terms: Integers
    numbers: Array
    layout: Integers
    slopes: Integers
    switches: Integers
    resets: Integers
    clocks: Integers

    @property
    def dimension(self) -> int:
        """Number of states n."""
        return int(self.layout[0])

    @property
    def parameters(self) -> int:
        """Number of parameters."""
        return int(self.layout[1])


Node = tuple[int, tuple[int, ...]]

_FUNCTIONS = {
    EXP: math.exp,
    SIN: math.sin,
    COS: math.cos,
    TAN: math.tan,
    SINH: math.sinh,
    COSH: math.cosh,
    TANH: math.tanh,
    LOG: math.log,
    SQRT: math.sqrt,
    ATAN: math.atan,
    ASIN: math.asin,
}


class Graph:
    """Operations under construction; nodes are numbers, in the order in which they came."""

    def __init__(self, dimension: int, parameters: int) -> None:
        self.nodes: list[Node] = []
        self.depends: list[int] = []
        self.weights: dict[int, int] = {}  # w of every function node
        self._known: dict[Node, int] = {}
        self.states = [self._new(STATE, (i,)) for i in range(dimension)]
        self.time = self._new(TIME, ())
        self.parameters = [self._new(PARAMETER, (i,)) for i in range(parameters)]
        self._values: list[float] = []

    # Construction

    def _new(self, code: int, operands: tuple[int, ...]) -> int:
        node = (code, operands)
        found = self._known.get(node)
        if found is not None:
            return found
        if code == STATE:
            depends = MOVING
        elif code == TIME:
            depends = TIMED
        elif code in (PARAMETER, NUMBER):
            depends = CONSTANT
        else:
            depends = max((self.depends[i] for i in operands), default=CONSTANT)
        self.nodes.append(node)
        self.depends.append(depends)
        self._known[node] = len(self.nodes) - 1
        return len(self.nodes) - 1

    def number(self, value: float) -> int:
        """The node of a number."""
        value = float(value)
        # The bits, because NaN equals nothing and 0.0 equals -0.0.
        bits = int(np.float64(value).view(np.int64))
        known = len(self.nodes)
        node = self._new(NUMBER, (bits,))
        if node == known:
            self._values.append(value)
        return node

    def value(self, node: int) -> float | None:
        """The value of a number node, None of any other."""
        code, operands = self.nodes[node]
        return float(np.int64(operands[0]).view(np.float64)) if code == NUMBER else None

    def terms(self, node: int) -> list[tuple[int, int]]:
        """A node as a sum: pairs of weight and node."""
        code, operands = self.nodes[node]
        if code == LINEAR:
            return list(zip(operands[::2], operands[1::2], strict=True))
        return [(self.number(1.0), node)]

    def linear(self, terms: Sequence[tuple[int, int]]) -> int:
        """A sum of nodes with constant weights."""
        constant = 0.0
        kept: dict[int, int] = {}
        for weight, node in terms:
            w, v = self.value(weight), self.value(node)
            if w == 0.0:
                continue
            if w is not None and v is not None:
                constant += w * v
                continue
            if v is not None:
                weight, node, w, v = node, weight, v, w  # a number times a parameter
                if w == 0.0:
                    continue
            if node in kept:
                other = self.value(kept[node])
                if w is not None and other is not None:
                    if w + other == 0.0:
                        del kept[node]
                    else:
                        kept[node] = self.number(w + other)
                    continue
                weight = self.linear([(self.number(1.0), kept[node]), (self.number(1.0), weight)])
            kept[node] = weight
        one = self.number(1.0)
        if constant != 0.0 or not kept:
            if not kept:
                return self.number(constant)
            kept[self.number(constant)] = one
        if len(kept) == 1:
            ((node, weight),) = kept.items()
            if weight == one:
                return node
        return self._new(LINEAR, tuple(i for node in sorted(kept) for i in (kept[node], node)))

    def add(self, a: int, b: int, sign: float = 1.0) -> int:
        """a + sign b."""
        return self.linear([(self.number(1.0), a), (self.number(sign), b)])

    def multiply(self, a: int, b: int) -> int:
        """a b."""
        if self.depends[a] > self.depends[b] or (self.depends[a] == self.depends[b] and a > b):
            a, b = b, a
        va, vb = self.value(a), self.value(b)
        if vb is not None:
            a, b, va, vb = b, a, vb, va
        if va is not None:
            if vb is not None:
                return self.number(va * vb)
            if va == 0.0:
                return self.number(0.0)
            if va == 1.0:
                return b
            if self.nodes[b][0] == LINEAR and len(self.nodes[b][1]) == 2:
                weight, node = self.nodes[b][1]
                return self.linear([(self.multiply(a, weight), node)])
        if self.depends[a] == CONSTANT and self.depends[b] != CONSTANT:
            return self.linear([(a, b)])
        if va is not None:
            return self.linear([(a, b)])
        if a == b:
            return self._new(SQUARE, (a,))
        # Numbers in front of a factor go in front of the product, where they cost nothing.
        for one, other in ((a, b), (b, a)):
            code, operands = self.nodes[one]
            if code == LINEAR and len(operands) == 2 and self.depends[other] != CONSTANT:
                return self.linear([(operands[0], self.multiply(operands[1], other))])
        return self._new(PRODUCT, (a, b))

    def divide(self, a: int, b: int) -> int:
        """a / b."""
        va, vb = self.value(a), self.value(b)
        if vb is not None and vb != 0.0:
            if va is not None:
                return self.number(va / vb)
            if math.frexp(vb)[0] in (0.5, -0.5):
                return self.multiply(self.number(1.0 / vb), a)  # exact
        if va == 0.0 and vb is None:
            return self.number(0.0)
        if self.depends[b] == CONSTANT and self.depends[a] != CONSTANT:
            return self.multiply(self._new(QUOTIENT, (self.number(1.0), b)), a)
        return self._new(QUOTIENT, (a, b))

    def power(self, a: int, exponent: int) -> int:
        """a to the power of another node."""
        number = self.value(exponent)
        if number is None:
            if self.depends[exponent] == CONSTANT:
                return self._general_power(a, exponent)
            return self.function(EXP, self.multiply(exponent, self.function(LOG, a)))
        if number == 0.0:
            return self.number(1.0)
        twice = 2.0 * number
        if twice != round(twice) or abs(number) > 64:
            return self._general_power(a, exponent)
        if number < 0:
            return self.divide(self.number(1.0), self.power(a, self.number(-number)))
        result = None if number == math.floor(number) else self.function(SQRT, a)
        whole = int(number)
        while whole:
            if whole & 1:
                result = a if result is None else self.multiply(result, a)
            whole >>= 1
            if whole:
                a = self.multiply(a, a)
        assert result is not None
        return result

    def _general_power(self, a: int, exponent: int) -> int:
        va, ve = self.value(a), self.value(exponent)
        if va is not None and ve is not None and va > 0:
            return self.number(va**ve)
        node = self._new(POWER, (a, exponent))
        if node not in self.weights:
            self.weights[node] = -1
            self.weights[node] = self.multiply(exponent, self.divide(node, a))
        return node

    def function(self, code: int, a: int) -> int:
        """A function of one node."""
        value = self.value(a)
        if value is not None:
            try:
                return self.number(_FUNCTIONS[code](value))
            except (ValueError, OverflowError):
                return self.number(math.nan)
        node = self._new(code, (a,))
        if node in self.weights:
            return node
        one = self.number(1.0)
        self.weights[node] = -1  # w may be made of the node itself
        if code == EXP:
            weight = node
        elif code in (SIN, COS):
            weight = self.function(COS if code == SIN else SIN, a)
        elif code in (SINH, COSH):
            weight = self.function(COSH if code == SINH else SINH, a)
        elif code == TAN:
            weight = self.add(one, self.multiply(node, node))
        elif code == TANH:
            weight = self.add(one, self.multiply(node, node), -1.0)
        elif code == LOG:
            weight = self.divide(one, a)
        elif code == SQRT:
            weight = self.divide(self.number(0.5), node)
        elif code == ATAN:
            weight = self.divide(one, self.add(one, self.multiply(a, a)))
        else:  # ASIN
            weight = self.divide(one, self.function(SQRT, self.add(one, self.multiply(a, a), -1.0)))
        self.weights[node] = weight
        return node

    def step(self, a: int) -> int:
        """The sign of a node: 1 or -1."""
        value = self.value(a)
        if value is not None:
            return self.number(math.copysign(1.0, value) if value else 0.0)
        code, operands = self.nodes[a]
        if code == STEP:
            return a
        if code == LINEAR and len(operands) == 2:  # one switch for every multiple of a switching function
            weight = self.value(operands[0])
            if weight is not None:
                return self.multiply(self.number(math.copysign(1.0, weight)), self.step(operands[1]))
        if code == LINEAR:
            weight = self.value(operands[0])
            if weight is not None and weight < 0:
                minus = self.number(-1.0)
                turned = self.linear([(self.multiply(minus, weight), node) for weight, node in self.terms(a)])
                return self.multiply(minus, self.step(turned))
        return self._new(STEP, (a,))

    def floor(self, a: int) -> int:
        """The largest whole number below a node."""
        value = self.value(a)
        return self._new(FLOOR, (a,)) if value is None else self.number(math.floor(value))

    def select(self, switch: int, above: int, below: int) -> int:
        """One node where another is positive, else a third."""
        sign = self.step(switch)
        value = self.value(sign)
        if above == below:
            return above
        if value is not None:
            return above if value > 0 else below
        code, operands = self.nodes[sign]
        if code == LINEAR:  # minus a step
            return self._new(SELECT, (operands[1], below, above))
        return self._new(SELECT, (sign, above, below))

    def leaves(self, node: int) -> list[int]:
        """The parameter nodes below a node."""
        return [i for i in self._reached([node], {}) if self.nodes[i][0] == PARAMETER]

    # Ordering

    def tape(
        self,
        slopes: Sequence[int],
        guards: Sequence[int] = (),
        resets: Sequence[Sequence[int]] = (),
    ) -> Tape:
        """Order the operations that these results need."""
        flat = self._flattened([*slopes, *guards, *(node for reset in resets for node in reset)])
        flow = self._reached([*slopes, *guards], flat)
        every = self._reached([*flow, *(node for reset in resets for node in reset)], flat)
        leaves = (STATE, TIME, PARAMETER)
        numbers = [i for i in every if self.nodes[i][0] == NUMBER]
        operations = [i for i in every if self.nodes[i][0] not in (*leaves, NUMBER)]
        constant = [i for i in operations if self.depends[i] == CONSTANT]
        moving = [i for i in operations if self.depends[i] != CONSTANT and i in set(flow)]
        later = [i for i in operations if self.depends[i] != CONSTANT and i not in set(flow)]
        order = [*self.states, self.time, *self.parameters, *numbers, *constant, *moving, *later]
        place = {node: i for i, node in enumerate(order)}
        live = self._live([*slopes, *guards, *(node for reset in resets for node in reset)], every, flat)
        program = np.zeros((5, len(order)), dtype=np.int64)
        terms: list[tuple[int, int]] = []
        switches: list[tuple[int, int, int]] = []
        for i, node in enumerate(order):
            code, operands = self.nodes[node]
            program[0, i] = code
            program[4, i] = node in live
            if code == LINEAR:
                program[1, i] = len(terms)
                terms += [(place[weight], place[term]) for weight, term in flat[node]]
                program[2, i] = len(terms)
            elif code in (STEP, FLOOR):
                program[1, i], program[2, i] = place[operands[0]], len(switches)
                switches.append((code, place[operands[0]], i))
            elif code not in (*leaves, NUMBER):
                program[1 : 1 + len(operands), i] = [place[operand] for operand in operands]
                if node in self.weights and self.depends[node] != CONSTANT:
                    program[3, i] = place[self.weights[node]]
        switches += [(GUARD, place[guard], k) for k, guard in enumerate(guards)]
        first = len(order) - len(constant) - len(moving) - len(later)
        layout = [
            len(self.states),
            len(self.parameters),
            first,
            first + len(constant),
            len(order) - len(later),
            len(order),
        ]
        return Tape(
            program=program,
            terms=np.array(terms, dtype=np.int64).reshape(-1, 2).T.copy(),
            numbers=np.array([self.value(i) for i in numbers], dtype=np.float64),
            layout=np.array(layout, dtype=np.int64),
            slopes=np.array([place[i] for i in slopes], dtype=np.int64),
            switches=np.array(switches, dtype=np.int64).reshape(-1, 3).T.copy(),
            resets=np.array([[place[i] for i in reset] for reset in resets], dtype=np.int64).reshape(-1, len(slopes)),
            clocks=np.array([place[i] for i in self._clocks(every, flat, [*slopes, *guards])], dtype=np.int64),
        )

    def _operands(self, node: int, flat: dict[int, list[tuple[int, int]]]) -> list[int]:
        code, operands = self.nodes[node]
        if code in (STATE, TIME, PARAMETER, NUMBER):
            return []
        if code == LINEAR:
            return [i for term in flat.get(node, self.terms(node)) for i in term]
        return list(operands)

    def _reached(self, roots: Sequence[int], flat: dict[int, list[tuple[int, int]]]) -> list[int]:
        """All nodes that some nodes need, in the order in which they came: every one after its operands."""
        seen: set[int] = set()
        ahead = list(roots)
        while ahead:
            node = ahead.pop()
            if node in seen:
                continue
            seen.add(node)
            ahead += self._operands(node, flat)
            if node in self.weights and self.depends[node] != CONSTANT:
                ahead.append(self.weights[node])
        return sorted(seen)

    def _flattened(self, roots: Sequence[int]) -> dict[int, list[tuple[int, int]]]:
        """The terms of the sums, those of a sum that only one other uses taken into that one."""
        reached = self._reached(roots, {})
        uses = dict.fromkeys(reached, 0)
        for node in roots:
            uses[node] += 1
        for node in reached:
            for operand in self._operands(node, {}):
                uses[operand] += 1
            if node in self.weights and self.depends[node] != CONSTANT:
                uses[self.weights[node]] += 1
        flat: dict[int, list[tuple[int, int]]] = {}
        for node in reached:
            if self.nodes[node][0] != LINEAR:
                continue
            flat[node] = []
            for weight, term in self.terms(node):
                if self.nodes[term][0] == LINEAR and uses[term] == 1 and self.depends[term] != CONSTANT:
                    flat[node] += [(self.multiply(weight, inner), part) for inner, part in flat[term]]
                else:
                    flat[node].append((weight, term))
        # Weights made here may be sums themselves.
        for node in self._reached([weight for terms in flat.values() for weight, _ in terms], flat):
            if self.nodes[node][0] == LINEAR and node not in flat:
                flat[node] = self.terms(node)
        return flat

    def _live(self, roots: Sequence[int], every: Sequence[int], flat: dict[int, list[tuple[int, int]]]) -> set[int]:
        """The nodes whose tangents are needed: not those that only serve as the w of a function."""
        surfaces = [self.nodes[i][1][0] for i in every if self.nodes[i][0] in (STEP, FLOOR)]
        ahead, live = [*roots, *surfaces], set[int]()
        while ahead:
            node = ahead.pop()
            if node in live or self.depends[node] != MOVING or self.nodes[node][0] in (STEP, FLOOR):
                continue
            live.add(node)
            ahead += self._operands(node, flat)
        return live

    def _clocks(self, every: Sequence[int], flat: dict[int, list[tuple[int, int]]], roots: Sequence[int]) -> list[int]:
        plain: set[int] = set()  # what a Taylor series sees from everywhere
        for node in every:
            code, operands = self.nodes[node]
            if code == TIME:
                plain.add(node)
            elif self.depends[node] == TIMED:
                parts = self._operands(node, flat)
                if code in (LINEAR, PRODUCT, SQUARE, SELECT):
                    simple = all(part in plain or self.depends[part] == CONSTANT for part in parts)
                elif code in (SIN, COS):
                    inner = operands[0]
                    simple = inner == self.time or (
                        self.nodes[inner][0] == LINEAR
                        and all(self.depends[term] == CONSTANT or term == self.time for _, term in flat[inner])
                    )
                else:
                    simple = code in (STEP, FLOOR) and operands[0] in plain
                if simple:
                    plain.add(node)
        used = set(roots)
        for node in every:
            if self.depends[node] == MOVING or self.nodes[node][0] in (STEP, FLOOR):
                used.update(self._operands(node, flat))
        return [i for i in every if i in used and self.depends[i] == TIMED and i not in plain]
