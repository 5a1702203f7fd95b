"""Flows of taped stiff right-hand sides by implicit collocation (:mod:`.collocation`)."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows import deadline
from chilopod.flows.carrying import BUDGET, REPEATED, RESOLUTION, failure, longest_step, numerical_balance, pieces
from chilopod.flows.tracing import tape as ops
from chilopod.flows.tracing.tape import Tape
from chilopod.flows.tracing.trace import branches_of, evaluate, evaluate_jacobian
from chilopod.frozen import Array, ReadOnlyArrays

_STAGES, _OTHER_STAGES = 9, 7
_NEAREST = 3  # largest number of couplings between two states with their derivative under step control
_MOST_WORK = 3e9  # multiplications
_SMALL = 53  # number of unknowns of a step below which its cost hardly falls
_FEWEST_STEPS = 2000
_VOLUME_STEPS = 64  # fewest steps for the growth of volume
_FINER = 0.2
_SHAKE = 2.0**-52
_ROUNDING = 2.0**-49
_MANY = "takes too many steps, though they are implicit: the integration stopped"


@dataclass(frozen=True, eq=False)
class ImplicitFlow(ReadOnlyArrays):
    """Flow of a stiff tape without events and switches in the state."""

    tape: Tape  # the right-hand side, without events; it may switch in time, not in the state
    params: Array  # values of its parameters
    edges: Array  # times from 0 to the period that no step may straddle
    fast: Array  # borders of the parts of the period with fast changes, where steps are limited, shape (parts, 2)
    tolerance: float  # estimated error of a step, far above the error, relative to every state and derivative

    def __post_init__(self) -> None:
        if not can_be_implicit(self.tape):
            allowed = "'taylor', or a right-hand side that is smooth in the state"
            said = "does not support events or switches in the state"
            raise ParameterError(said, field="method", value="implicit", allowed=allowed)
        super().__post_init__()

    @functools.cached_property
    def _cuts(self) -> Array:
        switches = _switch_instants(self.tape, self.params, float(self.edges[-1]))
        return np.unique(np.concatenate([self.edges, self.fast.ravel(), switches]))

    def flow(self, x: Array, t0: float, t1: float) -> tuple[Array, Array]:
        """State at t1 and its derivative with respect to the state at t0."""
        return self._run(x, (t0, t1), _STAGES)[:2]

    def flow_with_error(self, x: Array, t0: float, t1: float) -> tuple[Array, Array, Array]:
        """The same with a bound on the error of every entry of the derivative: a multiple of the larger difference from
        two other computations, of lower order and of smaller steps, from disturbed starts, and round-off."""
        state, derivative, _ = self._run(x, (t0, t1), _STAGES)
        shake = _SHAKE * np.sign(np.cos(3.0 * np.arange(self.tape.dimension) + 1.0))
        lower = self._run(x * (1.0 + shake), (t0, t1), _OTHER_STAGES)[1]
        finer = self._run(x * (1.0 - shake), (t0, t1), _STAGES, _FINER)[1]
        difference = np.maximum(np.abs(lower - derivative), np.abs(finer - derivative))
        size = np.abs(derivative)
        with np.errstate(over="ignore"):  # an infinite bound
            return state, derivative, REPEATED * difference + _ROUNDING * (size + size @ size)

    def flow_states(self, states: Array, t0: float, t1: float) -> Array:
        """Many states, shape (states, n), without derivatives."""
        return np.array([self._run(x, (t0, t1), _STAGES, derived=False)[0] for x in states])

    def flow_volume(self, x: Array, t0: float, t1: float) -> tuple[float, float]:
        """Logarithm of the growth of volume, by Liouville's formula, and a bound on its error."""
        # The step control does not see the divergence of f.
        longest = (t1 - t0) / _VOLUME_STEPS
        volume, other = (self._run(x, (t0, t1), each, longest=longest)[2] for each in (_STAGES, _OTHER_STAGES))
        # Equal steps add up their round-off, of every stage.
        return volume, REPEATED * abs(volume - other) + _STAGES * _ROUNDING * abs(volume)

    def _run(
        self,
        x: Array,
        span: tuple[float, float],
        stages: int,
        finer: float = 1.0,
        derived: bool = True,
        longest: float = np.inf,
    ) -> tuple[Array, Array, float]:
        """State and derivative at t1, and the logarithm of the growth of volume, by a part of the tolerance."""
        from chilopod.flows.implicit import collocation as kernels  # numba takes half a second to import

        n, stop = self.tape.dimension, deadline.stop()
        # Copies, because numba would compile again for read-only arrays.
        x, params = np.array(x, dtype=np.float64), self.params.copy()
        if x.shape != (n,):
            # Compiled code would read out of bounds.
            raise ParameterError(f"has the wrong shape {x.shape}", field="x", allowed=f"({n},)")
        if not np.isfinite(x).all():
            raise AnalysisError("the state is not finite", field="rhs")
        units, near = self._coupling(x, 0.5 * sum(span))
        x, size, method = x / units, n if derived else 0, _method(stages)
        derivative, report = np.eye(size), np.zeros(3)
        result = kernels.Outcome(derivative, np.zeros(n), np.eye(size), report)
        # Rounding may make steps of the finer computation short.
        smallest = _SMALL if finer == 1.0 else 1
        budget = max(_FEWEST_STEPS, int(_MOST_WORK / max(n * stages, smallest) ** 3))
        for a, b in pieces(self._cuts, float(self.edges[-1]), *span):
            branches = _branches(self.tape, params, np.array([0.5 * (a + b)]))[:, 0].copy()
            limit = min(longest, longest_step(self.fast, float(self.edges[-1]), a, b))
            control = kernels.Control(a, b, limit, branches, finer * self.tolerance, budget, units, near, stop)
            status = kernels.advance(self.tape, method, params, x, control, result)
            if status:
                raise failure(status, report[1], _MANY if status == BUDGET else "")
            budget -= int(report[0])
        return x * units, derivative * (units[:, None] / units if derived else 1.0), float(report[2])

    def _coupling(self, x: Array, t: float) -> tuple[Array, NDArray[np.bool_]]:
        """Units of the states, shape (n,), that balance the jacobian, and the pairs of near states."""
        jacobian = np.abs(evaluate_jacobian(self.tape, t, x, self.params)[1])
        jacobian = np.where(np.isfinite(jacobian), jacobian, 0.0)
        links = (jacobian > 0.0) | np.eye(x.size, dtype=bool)
        return numerical_balance(jacobian), np.linalg.matrix_power(links.astype(np.int64), _NEAREST) > 0


def can_be_implicit(tape: Tape) -> bool:
    """True for a right-hand side without events that switches in time only."""
    return all(kind != ops.GUARD and tape.program[4, node] == 0 for kind, node in zip(*tape.switches[:2], strict=True))


def _branches(tape: Tape, params: Array, times: Array) -> Array:
    """Branches of switches that depend on time only, shape (switches, times)."""
    return branches_of(tape, evaluate(tape, tape.switches[1], times, np.zeros((tape.dimension, 1)), params))


def _switch_instants(tape: Tape, params: Array, period: float) -> Array:
    """Times at which switches of time alone leave their branches, by bisection from a grid over the period."""
    times = np.linspace(0.0, period, RESOLUTION + 1)
    found = []
    for s, branches in enumerate(_branches(tape, params, times)):
        for i in np.flatnonzero(np.diff(branches)):
            low, high = float(times[i]), float(times[i + 1])
            while low < 0.5 * (low + high) < high:
                middle = 0.5 * (low + high)
                if _branches(tape, params, np.array([middle]))[s, 0] == branches[i]:
                    low = middle
                else:
                    high = middle
            found.append(high)
    return np.array([t for t in found if t < period])


@functools.cache
def _method(stages: int) -> Any:
    """Radau IIA with an odd number of stages."""
    from scipy.special import roots_jacobi  # slow to import

    from chilopod.flows.implicit.collocation import Method

    nodes = np.append(0.5 * (1.0 + roots_jacobi(stages - 1, 1.0, 0.0)[0]), 1.0)
    # In Legendre polynomials, whose integrals are known: Lagrange polynomial j is the sum over k of inverse[k, j] P_k.
    inverse = np.linalg.inv(legendre.legvander(2.0 * nodes - 1.0, stages - 1))
    integrals = np.array([legendre.legval(2.0 * nodes - 1.0, legendre.legint(row, lbnd=-1)) for row in np.eye(stages)])
    matrix = np.ascontiguousarray(0.5 * integrals.T @ inverse)
    values = np.linalg.eigvals(np.linalg.inv(matrix))
    real = values[np.abs(values.imag).argmin()].real
    start = legendre.legvander(np.array([-1.0]), stages - 1)[0] @ inverse
    return Method(nodes, matrix, start, float(1.0 / real))
