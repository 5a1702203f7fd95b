"""Rings of equal cells: their eigenvalues are those of one cell for each wave number."""

import cmath
import math

import numpy as np
import pytest
from scipy.linalg import expm

from chilopod.stability.symmetry.groups import commutes, finite_group
from chilopod.stability.symmetry.isotypic import SymmetricKind, isotypic, symmetric_crossing
from chilopod.stability.unit_circle.spectra import CircleEvent
from helpers.spectra import farthest


def ring_group(cells, states, mirrored, scales):
    """The shift by one cell, and the reversal."""
    shift = np.roll(np.eye(cells), 1, axis=0)
    reversal = np.eye(cells)[::-1]
    generators = [np.kron(one, np.eye(states)) for one in ((shift, reversal) if mirrored else (shift,))]
    return finite_group([scales[:, None] * one / scales for one in generators])


def ring_matrix(own, from_left, from_right, cells):
    shift = np.roll(np.eye(cells), 1, axis=0)
    return np.kron(np.eye(cells), own) + np.kron(shift, from_left) + np.kron(shift.T, from_right)


@pytest.mark.parametrize("states", [1, 2, 3])
@pytest.mark.parametrize("cells", range(2, 13))
def test_mirrored_ring(cells, states):
    random = np.random.default_rng(100 * cells + states)
    scales = 10.0 ** random.uniform(-9.0, 9.0, cells * states)
    own, beside = random.standard_normal((2, states, states))
    group = ring_group(cells, states, True, scales)
    assert group.order == (2 * cells if cells > 2 else 2)
    blocks = isotypic(group)
    matrix = scales[:, None] * ring_matrix(own, beside, beside, cells) / scales
    assert commutes(group, matrix) < 1.0
    # One block for each wave number up to half the ring: simple at 0 and at half, double between.
    waves = range(cells // 2 + 1)
    assert len(blocks) == len(waves)
    left = [np.linalg.eigvals(own + 2.0 * math.cos(2.0 * math.pi * k / cells) * beside) for k in waves]
    doubles = sorted(1 if 2 * k % cells == 0 else 2 for k in waves)
    assert sorted(block.dimension for block in blocks) == doubles
    for block in blocks:
        assert block.real
        assert block.multiplicity == states
        found = np.linalg.eigvals(block.reduced(matrix))
        nearest = min(range(len(left)), key=lambda i: farthest(found, left[i]))
        assert farthest(found, left.pop(nearest)) < 1e-12


@pytest.mark.parametrize("states", [1, 2, 3])
@pytest.mark.parametrize("cells", range(2, 13))
def test_one_way_ring(cells, states):
    random = np.random.default_rng(100 * cells + states)
    scales = 10.0 ** random.uniform(-9.0, 9.0, cells * states)
    own, from_left = random.standard_normal((2, states, states))
    group = ring_group(cells, states, False, scales)
    assert group.order == cells
    matrix = scales[:, None] * ring_matrix(own, from_left, np.zeros_like(own), cells) / scales
    found = []
    for block in isotypic(group):
        assert block.real == (block.dimension == 1)
        found += np.linalg.eigvals(block.reduced(matrix)).tolist()
    waves = [own + cmath.exp(2j * math.pi * k / cells) * from_left for k in range(cells)]
    assert farthest(found, np.concatenate([np.linalg.eigvals(wave) for wave in waves])) < 1e-12


def test_five_van_der_pol_cells():
    """x'' = m x' - x + c (x_left + x_right - 2 x) in a ring, over a time T: wave number k has the quadratic
    s^2 - m s + 1 + 2 c (1 - cos(2 pi k / 5)) = 0, and multipliers exp(s T)."""
    growth, coupling, duration = 0.2, 0.7, 1.3
    own = np.array([[0.0, 1.0], [-1.0 - 2.0 * coupling, growth]])
    beside = np.array([[0.0, 0.0], [coupling, 0.0]])
    group = ring_group(5, 2, True, np.ones(10))
    blocks = isotypic(group)
    matrix = expm(duration * ring_matrix(own, beside, beside, 5))
    reduced = [block.reduced(matrix[None]) for block in blocks]
    assert [block.dimension for block in blocks] == [1, 2, 2]
    for block, (matrix,) in zip(blocks, reduced, strict=True):
        # The character of the shift is 2 cos(2 pi k / 5), that of the constant 1.
        cosine = np.trace(block.representation[1]) / block.dimension
        stiffness = 1.0 + 2.0 * coupling * (1.0 - cosine)
        root = cmath.sqrt(0.25 * growth**2 - stiffness)
        known = [cmath.exp((0.5 * growth + sign * root) * duration) for sign in (1, -1)]
        assert farthest(np.linalg.eigvals(matrix), known) < 1e-13
        crossing = symmetric_crossing(block, CircleEvent.PAIR)
        assert crossing.kind is (
            SymmetricKind.SYMMETRY_KEPT if block.trivial else SymmetricKind.SYMMETRIC_NEIMARK_SACKER
        )


def test_forty_cells():
    random = np.random.default_rng(0)
    blocks = isotypic(ring_group(40, 2, True, 10.0 ** random.uniform(-9.0, 9.0, 80)))
    assert [block.dimension for block in blocks] == [1, 1, *[2] * 19]
    assert all(block.multiplicity == 2 for block in blocks)
