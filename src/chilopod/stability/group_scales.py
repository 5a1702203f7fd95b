"""Scales of coordinates in which the matrices of a finite group have entries of order one.

A symmetry written in a user's units is S P S^-1 with P well scaled and S diagonal, its entries many orders of magnitude
apart. No matrix of units is asked for: with P orthogonal, the largest size that an entry reaches over the powers of
the generators is s_i V_ij / s_j with V symmetric, because the inverse of an orthogonal matrix is its transpose and one
of its powers. So s_i / s_j is the root of the ratio of the entries (i, j) and (j, i).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LINKED = 1e-6
"""Two coordinates whose entries have at least this geometric mean (of any units) act on each other."""

_NOISE = 1e-12
"""Below this mean both entries are round-off; between the two, one of them is and the other one is not."""


def coordinate_scales(envelope: Array) -> Array:
    """Scales s, shape (n,), such that the entries of a group, divided by s_i / s_j, are of order one.

    Parameters
    ----------
    envelope
        Largest absolute value of each entry over the powers of the generators, shape (n, n); its diagonal is not zero.

    Notes
    -----
    Coordinates that act on each other are scaled along a maximal spanning tree of the geometric means. Groups of them
    that do not act on each other keep their mean scale in the user's units, and where one group acts on another one
    but not the other way round (positions relative to a first one), scales rise until that entry is at most one.
    """
    mean = np.sqrt(envelope) * np.sqrt(envelope.T)
    strength = np.where((mean >= _LINKED) | (mean <= _NOISE), mean, 0.0)
    logarithms, component = _along_trees(envelope, strength)
    with np.errstate(divide="ignore"):
        reach = np.log(envelope) + logarithms[None, :] - logarithms[:, None]
    # Round-off of the entry beside the one that counts is no constraint.
    reach = np.where(reach >= reach.T, reach, -np.inf)
    between: Array = np.full((component.max() + 1, component.max() + 1), -np.inf)
    np.maximum.at(between, (component[:, None], component[None, :]), reach)
    np.fill_diagonal(between, 0.0)
    shift = np.zeros(len(between))
    for _ in range(len(between)):  # the longest chain of groups, one acting on the next
        shift = np.asarray((between + shift[None, :]).max(axis=1))
    return np.asarray(np.exp(logarithms + (shift - shift.mean())[component]))


def _along_trees(envelope: Array, strength: Array) -> tuple[Array, NDArray[np.intp]]:
    """Logarithms of the scales, mean zero in each tree, and the number of the tree that each coordinate is in."""
    n = len(envelope)
    logarithms, component = np.zeros(n), np.full(n, -1)
    for number, root in enumerate(range(n)):
        if component[root] >= 0:
            continue
        component[root] = number
        best, nearest = strength[root].copy(), np.full(n, root)
        for _ in range(n):  # Prim's algorithm
            open_strength = np.where(component < 0, best, 0.0)
            new = int(open_strength.argmax())
            if open_strength[new] == 0.0:
                break
            old = nearest[new]
            component[new] = number
            logarithms[new] = logarithms[old] + 0.5 * np.log(envelope[new, old] / envelope[old, new])
            closer = strength[new] > best
            best, nearest = np.where(closer, strength[new], best), np.where(closer, new, nearest)
        logarithms[component == number] -= logarithms[component == number].mean()
    return logarithms, np.unique(component, return_inverse=True)[1]
