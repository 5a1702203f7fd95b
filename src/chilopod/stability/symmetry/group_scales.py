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

_ROUND_OFF = 1e-12
"""An entry smaller than this part of what goes from one coordinate to the other over a third one is round-off."""

_SMALLEST = 1e-11
"""An entry below this, in the user's units, that has none opposite is round-off too."""


def coordinate_scales(envelope: Array) -> Array:
    """Scales s, shape (n,), such that the entries of a group, divided by s_i / s_j, are of order one.

    Parameters
    ----------
    envelope
        Largest absolute value of each entry over the powers of the generators, shape (n, n); its diagonal is not zero.

    Notes
    -----
    Coordinates that act on each other are scaled along a maximal spanning tree of the geometric means. Sets of them
    that do not act on each other keep their mean scale in the user's units. Where one set acts on another one but not
    the other way round (positions relative to a first one), the largest entry becomes one, unless it is so small in the
    user's units that it must be taken for round-off.
    """
    envelope = np.where(envelope < _ROUND_OFF * (envelope @ envelope), 0.0, envelope)
    within, sets = _along_trees(envelope, np.sqrt(envelope) * np.sqrt(envelope.T))
    with np.errstate(divide="ignore"):
        reach = np.log(envelope) + within[None, :] - within[:, None]
    between = np.full((sets.max() + 1, sets.max() + 1), -np.inf)
    np.maximum.at(between, (sets[:, None], sets[None, :]), reach)
    # Where two sets have entries both ways, they are not opposite each other: the larger one counts.
    forward = (between > between.T) & (between > np.log(_SMALLEST))
    ratio = np.where(forward, between, np.where(forward.T, -between.T, 0.0))
    strength = np.where(forward | forward.T, np.exp(-np.abs(ratio)), 0.0)
    return np.asarray(np.exp(within + _along_trees(np.exp(ratio), strength)[0][sets]))


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
