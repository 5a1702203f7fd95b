"""Eigenvalues of the derivative of a return with directions that decay beyond all resolution.

The derivative of the flow does not resolve a direction that decays by e^-1000 within a step of an implicit method, and
the multipliers do not need it. Its exponent is the mean stretching rate of an orthonormal frame that the flow
carries, whose first k columns span the space of the k slowest directions for every k (Dieci,
Russell and Van Vleck, *SIAM Journal on Numerical Analysis* 34, 402, 1997).
"""

from __future__ import annotations

import numpy as np

from chilopod.errors import AnalysisError
from chilopod.flows.implicit.flow import Stretched
from chilopod.frozen import Array, ComplexArray
from chilopod.stability.problem.capabilities import FlowsFrames, SystemLike, is_autonomous
from chilopod.stability.problem.returns import ReturnMap
from chilopod.stability.spectrum.cut import Cut, equal_cut, section_basis, turn_in_units
from chilopod.stability.spectrum.errors import SAFETY, disturbed
from chilopod.stability.spectrum.splitting import intersection, split_leading

_DRAWS = 3  # each costs as much as the result
_PARTS = 64
_PASSES = 12
_DEEPEST = -7.0  # logarithm of the stretch within a part below which the frame replaces the derivative
_SETTLED = 1e-9  # relative change of a logarithm from one pass to the next
_UNSURE = 1e-6  # largest relative error of a logarithm
_GAP = 1.0  # least gap between the logarithms of separate directions
_TURNED = 0.1  # cosine of the angle at which the sign of a direction is lost
_SAME = 1e-8  # relative difference of the logarithms of two computations in a part that agree
_NOISE = 1e-12  # the same relative to the largest logarithm
_HALVINGS = 200  # halvings of other parts in a pass
_SHORTENINGS = 100
_LEFT, _APART = 1e-12, 1e-4  # stretches over a short time above round-off, and that separate directions


def split_stiff(system: FlowsFrames, x: Array, image: ReturnMap) -> tuple[ComplexArray, ComplexArray, Array]:
    """Logarithms of the eigenvalues of the return map at a state on the orbit, its eigenvectors, and the errors of the
    logarithms.

    Directions that the derivative of the flow resolves are split by it; the others, which must be real and of different
    sizes, have the stretch of the frame and its sign. The fastest has all digits, by Liouville's formula; several share
    an error; AnalysisError if that exceeds 1e-6 of either.
    """
    cut = equal_cut(system, x, image, _PARTS)
    frame, logarithms, signs, unsure = _carried(system, cut)
    total, n = logarithms.sum(axis=0), logarithms.shape[1]
    deep = np.flatnonzero((logarithms < _DEEPEST).any(axis=0))
    slow = int(deep[0]) if deep.size else n
    apart = np.diff(total, prepend=np.inf)[slow:] < -_GAP
    if not (apart.all() and (unsure[slow:] <= _UNSURE * np.abs(total[slow:])).all() and signs[slow:].all()):
        raise AnalysisError("several directions decay too fast to be separated", field="flow")
    values: list[ComplexArray] = []
    modes: list[ComplexArray] = []
    moved = unsure.copy()
    if slow:
        leading, vectors = split_leading(cut.factors, slow)
        for drawn in disturbed(np.array(cut.factors), np.array(cut.errors), _DRAWS):
            others = np.abs(leading[:, None] - split_leading(drawn, slow)[0])
            moved[:slow] = np.maximum(moved[:slow], SAFETY * others.min(axis=1))
        values, modes = [leading], [vectors]
    for k in range(slow, n):
        values.append(np.array([total[k] + (0.0 if signs[k] > 0 else 1j * np.pi)]))
        modes.append(intersection(frame[:, : k + 1], _fastest(system, cut, k), 1).astype(np.complex128))
    return np.concatenate(values), np.asarray(cut.basis @ np.hstack(modes), dtype=np.complex128), moved


def _carried(system: FlowsFrames, cut: Cut) -> tuple[Array, Array, Array, Array]:
    """The frame at time 0, its logarithms of stretch by parts, its signs on return (0 if lost), errors of the sums."""
    units, n = cut.units, cut.units.size
    along = 1 if is_autonomous(system) else 0
    frame = np.linalg.qr(np.random.default_rng(0).standard_normal((n, n)))[0]
    before = np.full(n - along, np.inf)
    for turn in range(_PASSES):
        start = frame = _behind_motion(system, frame, cut.states[0], units)
        left = _HALVINGS if turn else 0  # the first pass only turns the frame into place
        logarithms, others, turned = np.zeros((_PARTS, n)), np.zeros(n), np.ones(n)
        for k in range(_PARTS):
            t0, t1 = float(cut.times[k]), float(cut.times[k + 1])
            part, halved = _stretched(system, cut.states[k], units, frame, t0, t1, left)
            left -= halved
            frame, turned = part.frame, np.minimum(turned, part.turned)
            logarithms[k] = part.stretch
            others += part.other
        frame, upper = _orthonormal(turn_in_units(system, units) @ frame)
        logarithms[-1] += np.log(np.diag(upper))
        others += np.log(np.diag(upper))
        total = logarithms[:, along:].sum(axis=0)
        moved = np.abs(total - before)
        if (moved <= _SETTLED * np.abs(total)).all():
            break
        before = total
    end = _behind_motion(system, frame, cut.states[0], units)
    signs = np.where(turned > _TURNED, np.sign((end * start).sum(axis=0)), 0.0)[along:]
    section = _orthonormal(cut.sections[0].T @ start[:, along:])[0]
    return section, logarithms[:, along:], signs, moved + np.abs(total - others[along:])


def _stretched(
    system: FlowsFrames, state: Array, units: Array, frame: Array, t0: float, t1: float, most: int
) -> tuple[Stretched, int]:
    """A frame over a part, and the number of halvings of the part, at most ``most``: it is halved if two computations
    differ, as where a direction turns from a fast decay to a slow one."""
    n = units.size
    sums, turned, halved = np.zeros((2, n)), np.ones(n), 0
    ends = [t1]
    while ends:
        part = system.flow_frame(state, units, _behind_motion(system, frame, state, units), t0, ends[-1])
        both = np.stack([part.stretch, part.other])
        if is_autonomous(system):
            # The stretch of the motion is known; the second has the rest of the stretch of the first two's plane.
            speeds = [float(np.linalg.norm(np.asarray(system.velocity(x)) / units)) for x in (state, part.state)]
            known = np.log(speeds[1] / speeds[0])
            both[:, 1:2] += both[:, :1] - known
            both[:, 0] = known
        size = np.abs(both[0])
        if halved < most and (np.abs(both[1] - both[0]) > _SAME * np.maximum(1.0, size) + _NOISE * size.max()).any():
            halved += 1
            ends.append(0.5 * (t0 + ends[-1]))
            continue
        state, frame, t0 = part.state, part.frame, ends.pop()
        sums, turned = sums + both, np.minimum(turned, part.turned)
    return Stretched(state, frame, sums[0], sums[1], turned), halved


def _behind_motion(system: SystemLike, frame: Array, state: Array, units: Array) -> Array:
    """The frame with the motion as its first direction if a system does not depend on time."""
    if not is_autonomous(system):
        return frame
    velocity = np.asarray(system.velocity(state)) / units
    return _orthonormal(np.column_stack([velocity, frame[:, 1:]]))[0]


def _orthonormal(matrix: Array) -> tuple[Array, Array]:
    """QR decomposition with a positive diagonal."""
    q, r = np.linalg.qr(matrix)
    signs = np.where(np.diag(r) < 0.0, -1.0, 1.0)
    return q * signs, r * signs[:, None]


def _fastest(system: SystemLike, cut: Cut, k: int) -> Array:
    """Orthonormal basis of the directions at time 0 that decay faster than the first k, on the section: those that the
    flow contracts most, over a time so short that they are still above round-off."""
    if k == 0:
        return np.eye(cut.sections[0].shape[1])
    duration = float(cut.times[-1])
    for _ in range(_SHORTENINGS):
        state, derivative = system.flow(cut.states[0].copy(), 0.0, duration)
        derivative = derivative * cut.units / cut.units[:, None]
        after = section_basis(system, state, cut.units)
        stretch, right = np.linalg.svd(after.T @ derivative @ cut.sections[0])[1:]
        if stretch[k] >= _LEFT * max(1.0, stretch[0]):
            if stretch[k] <= _APART * stretch[k - 1]:
                return np.asarray(right[k:].T)
            break
        duration *= 0.5
    raise AnalysisError("the flow contracts too strongly to be resolved", field="flow")
