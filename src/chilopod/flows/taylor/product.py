"""Product of the derivatives of the steps of a motion, with a bound on its error, for :mod:`.stepping`.

An error e_s of the derivative of a step adds |P_s| e_s |D_s| to the bound, with D_s the product of the derivatives
before the step and P_s that after it. These products run over blocks of steps: the absolute value of a product is
smaller than the product of the absolute values.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from chilopod.compiled import assign, fused_njit

BLOCK = 64
"""Number of steps in a block."""

ROUNDING = 2.0**-53


class Product(NamedTuple):
    """The derivative of a motion, and a bound on its error."""

    total: Any  # product of all steps but those of the last block, shape (n, columns)
    bound: Any  # bound on the error of ``total``, shape (n, n); shape (0, 0) for none, and no blocks
    factors: Any  # derivatives of the steps of the last block, shape (BLOCK, n, n)
    errors: Any  # bounds on their errors, shape (BLOCK, n, n)


@fused_njit(error_model="numpy", inline="always")
def bound_error(tangents: Any, order: int, h: float, error: Any) -> None:
    """Bound on the error of the derivative of a step: round-off of its terms, and the last terms."""
    n, last = error.shape[0], h**order
    for i in range(n):
        for j in range(n):
            s = 0.0
            for k in range(order, 0, -1):
                s = (s + abs(tangents[i, k, j])) * h
            error[i, j] = 4.0 * ROUNDING * s + abs(tangents[i, order, j]) * last
        error[i, i] += 2.0 * ROUNDING


@fused_njit(error_model="numpy", inline="always")
def multiply(product: Product, count: int, factor: Any, stepwise: bool) -> int:
    """Take in the derivative of a step, the last of ``count`` + 1 in the block; return the number in the block."""
    if product.bound.shape[0] > 0:
        assign(product.factors[count], factor)
        count += 1
        if count == BLOCK:
            absorb(product, count)
            count = 0
    elif factor.shape[1] > 0:
        assign(product.total, factor @ product.total if stepwise else factor)
    return count


@fused_njit(error_model="numpy")
def absorb(product: Product, count: int) -> None:
    """Multiply the total by the factors of the block, and carry its bound."""
    total, bound = product.total, product.bound
    n = total.shape[0]
    before = np.empty((count + 1, n, n))
    assign(before[0], np.eye(n))
    for s in range(count):
        assign(before[s + 1], product.factors[s] @ before[s])
    after = np.eye(n)
    fresh = np.zeros((n, n))
    for s in range(count - 1, -1, -1):
        fresh += np.abs(after) @ product.errors[s] @ np.abs(before[s])
        after = after @ product.factors[s]
    assign(bound, np.abs(before[count]) @ bound + fresh @ np.abs(total))
    assign(total, before[count] @ total)
