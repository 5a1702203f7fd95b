"""Eigenvalues of the derivative of a return with one direction that decays beyond all resolution.

The derivative of the flow does not resolve a direction that decays by e^-1000 within a step of an implicit method, and
the multipliers do not need it. Its exponent is that of the volume, the integral of the divergence of f (Liouville's
formula), less those of the other directions.
"""

from __future__ import annotations

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.frozen import Array, ComplexArray
from chilopod.stability.problem.capabilities import FlowsVolumes, SystemLike
from chilopod.stability.problem.returns import ReturnMap
from chilopod.stability.spectrum.cut import Cut, moderate_cut, section_basis
from chilopod.stability.spectrum.errors import SAFETY, disturbed
from chilopod.stability.spectrum.splitting import split_leading

_DRAWS = 3  # each costs as much as the result
_SHORTENINGS = 100
_LEFT, _APART = 1e-12, 1e-4  # stretches over a short time above round-off, and that separate directions


def split_stiff(system: FlowsVolumes, x: Array, image: ReturnMap) -> tuple[ComplexArray, ComplexArray, Array]:
    """Logarithms of the eigenvalues of the return map at a state on the orbit, its eigenvectors, and the errors of the
    logarithms; AnalysisError if more than one direction decays too fast to be resolved."""
    cut = moderate_cut(system, x, image, unresolved=1)
    slow = cut.sections[0].shape[1] - 1
    values, modes, errors = np.empty(0, np.complex128), np.empty((slow + 1, 0), np.complex128), np.zeros(slow)
    if slow:
        values, modes = split_leading(cut.factors, slow)
        for drawn in disturbed(np.array(cut.factors), np.array(cut.errors), _DRAWS):
            others = np.abs(values[:, None] - split_leading(list(drawn), slow)[0])
            errors = np.maximum(errors, SAFETY * others.min(axis=1))
    growth, error = system.flow_volume(x, 0.0, float(cut.times[-1]))
    turned = system.symmetry is not None and np.linalg.det(system.symmetry) < 0.0
    fastest = complex(growth, np.pi if turned else 0.0) - values.sum()
    modes = np.hstack([modes, _fastest(system, cut, slow)])
    return np.append(values, fastest), np.asarray(cut.basis @ modes), np.append(errors, error + errors.sum())


def _fastest(system: SystemLike, cut: Cut, slow: int) -> Array:
    """The direction on the section at time 0 that the flow contracts most, over a time so short that it is still above
    round-off, shape (slow + 1, 1)."""
    if slow == 0:
        return np.eye(1)
    duration = float(cut.times[-1])
    for _ in range(_SHORTENINGS):
        state, derivative = system.flow(cut.states[0].copy(), 0.0, duration)
        derivative = derivative * cut.units / cut.units[:, None]
        after = section_basis(system, state, cut.units)
        stretch, right = np.linalg.svd(after.T @ derivative @ cut.sections[0])[1:]
        if stretch[slow] >= _LEFT * max(1.0, stretch[0]):
            if stretch[slow] <= _APART * stretch[slow - 1]:
                return np.asarray(right[slow:].T)
            break
        duration *= 0.5
    raise AnalysisError("the flow contracts too strongly to be resolved", field="flow")
