"""A return cut into parts, between sections across the motion if a system does not depend on time."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.flows.balance import numerical_balance
from chilopod.frozen import Array
from chilopod.stability.problem.capabilities import SystemLike, is_autonomous
from chilopod.stability.problem.returns import ReturnMap, flow_with_error
from chilopod.stability.problem.scales import sizes
from chilopod.stability.spectrum.eigenvalues import normal_basis

_WORST_CONDITION = 1e6
_FEWEST, _MOST, _MOST_STIFF = 8, 32768, 4096  # numbers of parts of moderate condition; steps of a stiff flow are costly
_COMPOSED = 1e-6  # error of the product of the parts, relative to the whole, above which the flow has no parts


@dataclass(frozen=True)
class Cut:
    """A return in parts, between planes across the motion if a system does not depend on time."""

    units: Array  # sizes of the states, shape (n,)
    section: Array  # orthonormal basis of the first plane, or of the space, in units
    factors: Sequence[Array]  # derivatives of the flow over the parts, the last one with the symmetry in time
    errors: Sequence[Array]  # bounds on the errors of their entries

    @property
    def basis(self) -> Array:
        """The first plane in the units of the system."""
        return self.units[:, None] * self.section


@dataclass(frozen=True)
class _Part:
    """The derivative of the flow over a part of the return, with the bound on its error, in units; and its end."""

    start: float
    end: float
    state: Array
    factor: Array
    error: Array


def moderate_cut(system: SystemLike, x: Array, image: ReturnMap, unresolved: int = 0) -> Cut:
    """A return from a state on the orbit in parts of moderate condition, apart from the ``unresolved`` fastest
    directions; AnalysisError if there are none. The return of a map, which has no parts, stays whole."""
    # The derivative on a section may be only round-off; an orbit that moves gives the sizes.
    autonomous, duration = is_autonomous(system), image.duration
    units = sizes(system, x, duration) if autonomous else numerical_balance(image.jacobian)
    parts: list[_Part] = []
    for start, end in itertools.pairwise(np.linspace(0.0, duration, _FEWEST + 1).tolist()):
        parts.append(_part(system, parts[-1].state if parts else x, start, end, units))
    if not (autonomous or unresolved):
        ratios = units / units[:, None]
        whole = image.jacobian * ratios
        product = np.linalg.multi_dot([turn_in_units(system, units), *(part.factor for part in reversed(parts))])
        if np.abs(product - whole).max() > _COMPOSED * np.abs(whole).max():
            error = np.nan_to_num(np.broadcast_to(image.error, whole.shape) * ratios)
            return Cut(units, np.eye(x.size), [whole], [error])
    parts = _of_moderate_condition(system, x, parts, units, unresolved)
    sections = [section_basis(system, state, units) for state in (x, *(part.state for part in parts[:-1]))]
    turns = [np.eye(x.size)] * (len(parts) - 1) + [turn_in_units(system, units)]
    factors, errors = [], []
    for part, turn, (before, after) in zip(parts, turns, itertools.pairwise([*sections, sections[0]]), strict=True):
        factors.append(after.T @ turn @ part.factor @ before)
        errors.append(np.abs(after.T) @ np.abs(turn) @ part.error @ np.abs(before))
    return Cut(units, sections[0], factors, errors)


def turn_in_units(system: SystemLike, units: Array) -> Array:
    """Symmetry in time in scaled units, shape (n, n); the unit matrix if there is none."""
    return np.eye(units.size) if system.symmetry is None else system.symmetry * units / units[:, None]


def section_basis(system: SystemLike, state: Array, units: Array) -> Array:
    """Orthonormal basis of the plane across the motion, in units, shape (n, n-1), or of the whole space."""
    if not is_autonomous(system):
        return np.eye(units.size)
    return normal_basis(np.asarray(system.velocity(state)) / units)


def _part(system: SystemLike, x: Array, start: float, end: float, units: Array) -> _Part:
    state, derivative, error = flow_with_error(system, x.copy(), start, end)
    factor = derivative * units / units[:, None]
    return _Part(start, end, state, factor, np.broadcast_to(error, factor.shape) * units / units[:, None])


def _of_moderate_condition(
    system: SystemLike, x: Array, parts: list[_Part], units: Array, unresolved: int
) -> list[_Part]:
    """Parts of a return; those that contract too strongly are halved repeatedly."""
    done: list[_Part] = []
    left, asked, most = parts[::-1], len(parts), _MOST_STIFF if unresolved else _MOST
    while left:
        part = left.pop()
        stretches = np.linalg.svd(part.factor, compute_uv=False)
        # The errors of a stiff flow are relative to the states at the start.
        largest, kept = max(stretches[0], float(unresolved)), stretches[: stretches.size - unresolved]
        if not kept.size or largest < _WORST_CONDITION * kept[-1]:
            done.append(part)
            continue
        middle = 0.5 * (part.start + part.end)
        asked += 2
        if asked > most or not part.start < middle < part.end:
            raise AnalysisError("the flow contracts too strongly to be resolved", field="flow")
        first = _part(system, done[-1].state if done else x, part.start, middle, units)
        left += [_part(system, first.state, middle, part.end, units), first]
    return done
