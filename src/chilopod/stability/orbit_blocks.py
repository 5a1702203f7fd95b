"""Blocks of an orbit's return map by its spatial symmetries, and crossings of the unit circle in each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from chilopod.frozen import Array
from chilopod.stability.orbits.orbit import Orbit
from chilopod.stability.problem.capabilities import SystemLike, spatial_symmetries
from chilopod.stability.symmetry.groups import centraliser, commutes, finite_group, isotropy
from chilopod.stability.symmetry.isotypic import Block, isotypic
from chilopod.stability.unit_circle.crossings import Crossings
from chilopod.stability.unit_circle.spectra import Matrices

Blocks = tuple[Block | None, ...]
"""Blocks of a return map; a single None is the whole map."""


def orbit_blocks(system: SystemLike, orbit: Orbit) -> tuple[Blocks, tuple[str, ...]]:
    """The blocks of the symmetries of an orbit, and a sentence if it has none of the system's."""
    generators = spatial_symmetries(system)
    if not generators:
        return (None,), ()
    group = finite_group(np.stack(generators))
    if system.symmetry is not None:
        group = centraliser(group, system.symmetry)
    group = isotropy(group, orbit.state, np.nan_to_num(orbit.error))
    if group.order == 1:
        return (None,), ("the orbit has none of the spatial symmetries",)
    if commutes(group, orbit.image.jacobian, orbit.image.error) > 1.0:
        return (None,), ("the return map does not have the spatial symmetries: they are not used",)
    return isotypic(group), ()


def crossings_in(block: Block | None, matrices: Matrices, search: Callable[[Matrices], Crossings]) -> Crossings:
    """Crossings in a block of return maps, with multiplicities in the whole map."""
    if block is None:
        return search(matrices)

    def reduced(values: Array) -> tuple[Array, Array]:
        whole, errors = matrices(values)
        return block.reduced(whole), block.reduced_error(whole, errors) if errors.ndim == 3 else errors

    found, times = search(reduced), block.repeats
    crossings = tuple(
        replace(each, multiplicity=times * each.multiplicity, change=times * each.change) for each in found.crossings
    )
    return replace(found, crossings=crossings)
