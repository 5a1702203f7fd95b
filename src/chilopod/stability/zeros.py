"""All zeros of an analytic function in an interval.

The interval is cut until the function is a polynomial of degree eight on every piece, to a small part of its size
there (the idea of Chebfun: Battles & Trefethen, SIAM J. Sci. Comput. 25, 2004). The zeros of the polynomials then say
where those of the function are; where two of them lie close together, or have just left the real axis, the piece
around them is looked at on its own scale.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DEGREE = 8
_NODES = np.cos(np.pi * np.arange(_DEGREE, -1, -1) / _DEGREE)
_TRANSFORM: Array = np.linalg.inv(chebyshev.chebvander(_NODES, _DEGREE)).astype(np.float64)
_CHECKS = np.array([-0.618, 0.137])  # the function is held against the polynomial here too
_DENSE = np.linspace(-1.0, 1.0, 65)
_RESOLVED = 1e-4  # of the largest value on the piece
_CLEAR = 4.0  # times what it may be wrong by: so far from zero a piece has none
_NEAR = 0.02  # a pair of zeros this close to each other, or to the real axis, relative to the piece, is looked at again
_FINEST = 1e-12  # width of a piece, relative to the interval


def brackets(function: Callable[[Array], Array], low: float, high: float) -> list[tuple[float, float]]:
    """Intervals in which the function changes sign, one zero each, in order.

    Parameters
    ----------
    function
        Takes values, shape (k,), gives values, shape (k,); it need not be scaled.
    low, high
        The interval.

    Returns
    -------
    Pairs (a, b) with f(a) f(b) < 0; a zero met exactly is a pair (a, a).
    """
    found: list[tuple[float, float]] = []
    stack = [(low, high)]
    while stack:
        a, b = stack.pop()
        half, middle = 0.5 * (b - a), 0.5 * (a + b)
        finest = b - a < _FINEST * (high - low)
        nodes = np.concatenate([_NODES, _CHECKS])
        values = function(np.clip(middle + half * nodes, a, b))
        coefficients = _TRANSFORM @ values[: _NODES.size]
        size = float(np.abs(values).max())
        off = np.abs(chebyshev.chebval(_CHECKS, coefficients) - values[_NODES.size :]).max()
        if size == 0.0:
            continue
        uncertain = float(max(off, np.abs(coefficients[-2:]).max()))
        inside, close = _roots(coefficients)
        if not inside.size and not close.size:
            dense = np.abs(chebyshev.chebval(_DENSE, coefficients))
            if dense.min() > _CLEAR * uncertain:
                continue
        if not finest and uncertain > _RESOLVED * size:
            stack += [(middle, b), (a, middle)]
            continue
        if close.size and not finest:
            stack += _around(a, b, middle + half * close[0], half)
            continue
        signs = _separated(function, inside, a, b, middle, half, values)
        changes = [(p, q) for (p, u), (q, v) in zip(signs, signs[1:], strict=False) if u * v < 0.0]
        exact = [p for p, u in signs if u == 0.0]
        if len(changes) + len(exact) != inside.size and not finest:
            stack += [(middle, b), (a, middle)]
            continue
        if changes and not exact and len(changes) == inside.size:
            slopes = chebyshev.chebval(inside, chebyshev.chebder(coefficients))
            changes = _narrowed(function, changes, middle + half * inside, _CLEAR * half * uncertain / np.abs(slopes))
        found += changes + [(p, p) for p in exact]
    unique = sorted(set(found))
    # A zero on the border of two pieces is an end of both.
    once = [pair for i, pair in enumerate(unique) if i == 0 or pair[0] != pair[1] or pair[0] > unique[i - 1][1]]
    return [pair for pair in once if pair[0] != pair[1] or _crosses(function, pair[0], low, high)]


def _narrowed(
    function: Callable[[Array], Array], changes: list[tuple[float, float]], roots: Array, reach: Array
) -> list[tuple[float, float]]:
    """Brackets cut down to what the polynomial may be wrong by, where the function changes sign there."""
    reach = np.maximum(reach, 1e-13 * np.abs(roots))
    left = np.maximum(roots - reach, [p for p, _ in changes])
    right = np.minimum(roots + reach, [q for _, q in changes])
    before, after = np.split(function(np.concatenate([left, right])), 2)
    return [
        (float(a), float(b)) if u * v < 0.0 and a < b else change
        for change, a, b, u, v in zip(changes, left, right, before, after, strict=True)
    ]


def _crosses(function: Callable[[Array], Array], zero: float, low: float, high: float) -> bool:
    """Whether the function changes sign at a zero that was met exactly, or may do so just outside the interval."""
    reach = 1e-9 * (high - low)
    if zero - low < reach or high - zero < reach:
        return True
    before, after = function(np.array([zero - reach, zero + reach]))
    return bool(before * after < 0.0)


def _roots(coefficients: Array) -> tuple[Array, Array]:
    """Real roots within the piece, and where roots come close to each other."""
    kept = np.trim_zeros(coefficients, "b")
    if kept.size < 2:
        return np.empty(0), np.empty(0)
    roots = chebyshev.chebroots(kept)
    near = roots[(np.abs(roots.real) <= 1.0) & (np.abs(roots.imag) < _NEAR)]
    real = np.sort(near.real[np.abs(near.imag) < 1e-10])
    pairs = 0.5 * (real[1:] + real[:-1])[np.diff(real) < _NEAR]
    return real, np.concatenate([near.real[near.imag > 1e-10], pairs])


def _around(a: float, b: float, center: float, half: float) -> list[tuple[float, float]]:
    """A piece cut in three, the middle one narrow about a center; in two where the center is near an end."""
    reach = 4.0 * _NEAR * half
    cuts = [a, *(c for c in (center - reach, center + reach) if a < c < b), b]
    return list(zip(cuts, cuts[1:], strict=False))[::-1]


def _separated(
    function: Callable[[Array], Array], roots: Array, a: float, b: float, middle: float, half: float, values: Array
) -> list[tuple[float, float]]:
    """Points that separate the roots, with the values of the function there."""
    between = 0.5 * (roots[1:] + roots[:-1])
    inner = middle + half * between
    inner_values = function(inner) if inner.size else np.empty(0)
    return [
        (a, float(values[0])),
        *zip(inner.tolist(), inner_values.tolist(), strict=True),
        (b, float(values[_DEGREE])),
    ]
