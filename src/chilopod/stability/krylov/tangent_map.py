"""The return map of a large system, with its derivative as what it does to directions."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.frozen import ReadOnlyArrays
from chilopod.stability.problem.capabilities import FlowsTangents, given_scale, is_autonomous, returns_per_period
from chilopod.stability.problem.returns import CUTS, REPEATED, Section, carried, return_duration, return_time

Array = NDArray[np.float64]

_PARTS = 16  # of a return
_SWEEPS, _MOST_SWEEPS = 3, 30
_DRAWS = 4  # random directions a sweep: as many as the compiled code carries at once
_STEADY = 2.0  # ratios of sizes that change by less are known well enough


@dataclass(frozen=True)
class TangentMap(ReadOnlyArrays):
    """The return map H at a state (see :mod:`~chilopod.stability.problem.returns`) and its derivative H', no matrix.

    Attributes
    ----------
    point, state
        The state at time 0 and H(point), shape (n,).
    duration, returns
        Duration of a return, and number of returns in the full period.
    velocity, normal
        dx/dt at ``state`` and the normal of the section, shape (n,), where the system does not depend on time; else
        None.
    """

    system: FlowsTangents
    point: Array
    state: Array
    duration: float
    returns: int
    velocity: Array | None
    normal: Array | None

    @property
    def section(self) -> Section | None:
        """The section that a return ends on, through ``point``."""
        return None if self.normal is None else Section(self.point, self.normal, self.duration)

    def images(self, directions: Array) -> Array:
        """H' times directions, shape (n, m) both."""
        return self._in_parts(directions, (0.0,))[1]

    def images_with_error(self, directions: Array) -> tuple[Array, Array, Array]:
        """The same, with bounds on the errors of the images, shape (n, m), and of ``state``, shape (n,): by their sizes
        as a whole, not of every entry.

        As in :func:`~chilopod.stability.problem.returns.flow_with_error` they are a multiple of the difference to a
        second computation which takes the interval in parts.
        """
        state, images = self._in_parts(directions, (0.0,))
        other, parts = self._in_parts(directions, CUTS)
        return images, REPEATED * np.abs(parts - images), REPEATED * np.abs(self._across(other - state))

    def _in_parts(self, directions: Array, cuts: tuple[float, ...]) -> tuple[Array, Array]:
        times = [cut * self.duration for cut in cuts] + [self.duration]
        state, images = self.point, directions
        for a, b in zip(times, times[1:], strict=False):
            state, images = self.system.flow_tangents(np.array(state), np.array(images), a, b)
            if np.shape(state) != self.point.shape or np.shape(images) != directions.shape:
                raise AnalysisError(
                    f"gives shapes {np.shape(state)} and {np.shape(images)}",
                    field="flow_tangents",
                    allowed=f"{self.point.shape} and {directions.shape}",
                )
        if not np.isfinite(images).all():
            raise AnalysisError("the flow is not finite over one return", field="flow")
        if self.system.symmetry is not None:
            state, images = self.system.symmetry @ state, self.system.symmetry @ images
        return state, self._across(images)

    def _across(self, directions: Array) -> Array:
        """Directions at the end of a return along the motion into the section."""
        if self.velocity is None or self.normal is None:
            return directions
        rate = float(self.normal @ self.velocity)
        along: Array = np.multiply.outer(self.velocity, self.normal @ directions) / rate
        return directions - along


def tangent_map(system: FlowsTangents, x: Array, section: Section | None = None) -> TangentMap:
    """The return map at a state at time 0, shape (n,); with the section where a return ends if the system does not
    depend on time.

    Raises
    ------
    AnalysisError
        If the flow gives anything that is not finite, or does not come back to the section.
    """
    velocity, normal = None, None
    duration = return_time(system, x, section) if is_autonomous(system) and section else return_duration(system)
    state = carried(system, x[None], 0.0, duration)[0]
    if not np.isfinite(state).all():
        raise AnalysisError("the flow is not finite over one return", field="flow")
    if system.symmetry is not None:
        state = system.symmetry @ state
    if is_autonomous(system):
        assert section is not None
        velocity, normal = np.asarray(system.velocity(np.array(state)), dtype=np.float64), section.normal
    return TangentMap(system, x, state, duration, returns_per_period(system), velocity, normal)


def tangent_sizes(system: FlowsTangents, x: Array, duration: float) -> Array:
    """Sizes of the states, shape (n,), as :func:`chilopod.stability.problem.scales.sizes` says, without the matrix.

    A state is as large as it becomes during a return, or as what the others, disturbed by their own sizes at random,
    make of it within a part of the return. Where the orbit is zero throughout that alone gives the ratios: the
    one-sided Krylov balancing of Chen and Demmel, *Linear Algebra Appl.* 309, 261-287, 2000.
    """
    given = given_scale(system)
    if given is not None:
        return given
    random = np.random.default_rng(0)
    times = np.linspace(0.0, duration, _PARTS + 1).tolist()
    state, size = x, np.abs(x)
    for a, b in itertools.pairwise(times):
        state = carried(system, state[None], a, b)[0]
        if not np.isfinite(state).all():
            raise AnalysisError("the flow is not finite over one return", field="flow")
        size = np.maximum(size, np.abs(state))
    moves = bool(size.any())
    if not moves:
        size = np.ones(x.size)
    for _ in range(_SWEEPS if moves else _MOST_SWEEPS):
        signs = random.choice([-1.0, 1.0], (x.size, _DRAWS))
        driven = np.sqrt(
            np.square(system.flow_tangents(np.array(x), size[:, None] * signs, 0.0, times[1])[1]).mean(axis=1)
        )
        larger = np.maximum(size, driven)
        if not moves:
            larger /= larger.max()
            if float((larger / size).max()) <= _STEADY * float((larger / size).min()):
                break
        size = larger
    return np.where(size > 0.0, size, size[size > 0.0].min())
