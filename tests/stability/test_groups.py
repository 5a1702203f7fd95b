"""Groups whose representations are in every book, in any units."""

import itertools
import math

import numpy as np
import pytest

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability.symmetry.groups import centraliser, commutes, finite_group, isotropy
from chilopod.stability.symmetry.isotypic import SymmetricKind, isotypic, symmetric_crossing
from chilopod.stability.unit_circle.spectra import CircleEvent
from helpers.spectra import farthest


def permutation(*images):
    return np.eye(len(images))[list(images)]


def shift(cells, states=1):
    return np.kron(np.roll(np.eye(cells), 1, axis=0), np.eye(states))


def reversal(cells, states=1):
    return np.kron(np.eye(cells)[[-i % cells for i in range(cells)]], np.eye(states))


def dihedral(cells, states=1):
    return np.array([shift(cells, states), reversal(cells, states)])


def cyclic(cells, states=1):
    return shift(cells, states)[None]


def regular(degree):
    """The symmetric group acting on itself: each irreducible representation as often as its dimension says."""
    every = list(itertools.permutations(range(degree)))
    number = {element: k for k, element in enumerate(every)}
    return np.array(
        [
            np.eye(len(every))[:, [number[tuple(g[i] for i in h)] for h in every]]
            for g in ((1, 0, *range(2, degree)), (*range(1, degree), 0))
        ]
    )


QUARTER_TURN = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
THIRD_TURN = permutation(1, 2, 0)
HALF_TURN = np.diag([1.0, -1.0, -1.0])

GROUPS = {
    "identity": np.eye(3)[None],
    "sign": -np.eye(2)[None],
    "C5, 2 states": cyclic(5, 2),
    "C12": cyclic(12),
    "D5, 2 states": dihedral(5, 2),
    "D6, 3 states": dihedral(6, 3),
    "T": np.array([THIRD_TURN, HALF_TURN]),
    "Td": np.array([THIRD_TURN, HALF_TURN, permutation(1, 0, 2)]),
    "O": np.array([THIRD_TURN, QUARTER_TURN]),
    "Oh": np.array([THIRD_TURN, QUARTER_TURN, -np.eye(3)]),
    "S4": np.array([permutation(1, 0, 2, 3), permutation(1, 2, 3, 0)]),
    "S4, regular": regular(4),
}
ORDERS = dict(zip(GROUPS, (1, 2, 5, 12, 10, 12, 12, 24, 24, 48, 24, 24), strict=True))


def in_units(matrices, scales):
    """Matrices as they are with the states in other units."""
    return scales[:, None] * np.asarray(matrices) / scales


def random_scales(random, size):
    return 10.0 ** random.uniform(-9.0, 9.0, size)


def commuting(elements, random):
    """A random matrix that commutes with some elements: P M P^-1 averaged over them."""
    n = elements.shape[1]
    return np.mean(elements @ random.standard_normal((n, n)) @ np.linalg.inv(elements), axis=0)


def spectrum_of(blocks, matrix):
    """Eigenvalues from the blocks, each as often as it should be there."""
    values = []
    for block in blocks:
        values += list(np.repeat(np.linalg.eigvals(block.reduced(matrix)).astype(complex), block.repeats))
    return values


def shapes(generators):
    """(d, type, copies, order of the kernel) of each block."""
    return [
        (block.dimension, "real" if block.real else "complex", block.multiplicity, int(block.kernel.sum()))
        for block in isotypic(finite_group(generators))
    ]


@pytest.mark.parametrize("name", GROUPS)
def test_closure_metric_and_inverses_in_any_units(name):
    scales = random_scales(np.random.default_rng(1), GROUPS[name].shape[1])
    group = finite_group(in_units(GROUPS[name], scales))
    assert group.order == ORDERS[name]
    np.testing.assert_array_equal(group.elements[0], np.eye(group.dimension))
    natural = in_units(group.elements, 1.0 / scales)
    distances = np.abs(natural[:, None] - natural).max(axis=(2, 3))
    assert distances[~np.eye(group.order, dtype=bool)].min(initial=1.0) > 0.1
    product = natural[-1] @ natural
    assert np.abs(product[:, None] - natural).max(axis=(2, 3)).min(axis=1).max() < 1e-12
    size = np.outer(group.scales, group.scales)
    metric = group.to_orthogonal.T @ group.to_orthogonal
    moved = np.swapaxes(group.elements, 1, 2) @ metric @ group.elements
    np.testing.assert_allclose(moved * size, np.tile(metric * size, (group.order, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(
        np.swapaxes(group.orthogonal, 1, 2) @ group.orthogonal,
        np.tile(np.eye(group.dimension), (group.order, 1, 1)),
        atol=1e-13,
    )


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("identity", [(1, "real", 3, 1)]),
        ("sign", [(1, "real", 2, 1)]),
        ("C5, 2 states", [(1, "real", 2, 5), *[(2, "complex", 2, 1)] * 2]),
        ("D6, 3 states", [(1, "real", 3, 12), (1, "real", 3, 6), (2, "real", 3, 2), (2, "real", 3, 1)]),
        ("T", [(3, "real", 1, 1)]),
        ("Oh", [(3, "real", 1, 1)]),
        ("S4", [(1, "real", 1, 24), (3, "real", 1, 1)]),
        (
            "S4, regular",
            [(1, "real", 1, 24), (1, "real", 1, 12), (2, "real", 2, 4), (3, "real", 3, 1), (3, "real", 3, 1)],
        ),
    ],
)
def test_irreducible_representations(name, known):
    assert shapes(GROUPS[name]) == known


def test_quaternionic_types_are_refused():
    i = np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, -1], [0, 0, 1, 0]])
    j = np.array([[0, 0, -1, 0], [0, 0, 0, 1], [1, 0, 0, 0], [0, -1, 0, 0]])
    with pytest.raises(AnalysisError, match="quaternionic"):
        isotypic(finite_group([i, j]))


@pytest.mark.parametrize("name", GROUPS)
def test_what_commutes_becomes_copies_of_its_reduced_matrix(name):
    random = np.random.default_rng(2)
    group = finite_group(GROUPS[name])
    blocks = isotypic(group)
    matrix = commuting(group.elements, random)
    basis = np.hstack([block.basis for block in blocks])
    dual = np.vstack([block.dual for block in blocks])
    np.testing.assert_allclose(dual @ basis, np.eye(group.dimension), atol=1e-13)
    for block in blocks:
        whole = np.kron(block.reduced(matrix), np.eye(block.repeats))
        np.testing.assert_allclose(block.dual @ matrix @ block.basis, whole, atol=1e-13)
        for element, rho in zip(group.elements, block.representation, strict=True):
            copies = np.kron(np.eye(block.multiplicity), rho) if block.real else block.dual @ element @ block.basis
            np.testing.assert_allclose(element @ block.basis, block.basis @ copies, atol=1e-13)


@pytest.mark.parametrize("name", ["C5, 2 states", "D6, 3 states", "S4, regular"])
def test_reduction_keeps_products(name):
    random = np.random.default_rng(3)
    group = finite_group(GROUPS[name])
    one, other = (commuting(group.elements, random) for _ in range(2))
    for block in isotypic(group):
        np.testing.assert_allclose(block.reduced(one @ other), block.reduced(one) @ block.reduced(other), atol=1e-12)


def eigenvalue_error(matrix):
    """Bound on what round-off does to the eigenvalues of a matrix."""
    vectors = np.linalg.eig(matrix)[1]
    conditions = np.linalg.norm(np.linalg.inv(vectors), axis=1)
    return 20.0 * len(matrix) * np.finfo(float).eps * np.linalg.norm(matrix) * conditions.max()


@pytest.mark.parametrize("seed", range(200))
def test_eigenvalues_of_random_matrices_in_random_units(seed):
    random = np.random.default_rng(seed)
    name = list(GROUPS)[seed % len(GROUPS)]
    n = GROUPS[name].shape[1]
    # A turn of the space keeps the matrices orthogonal, and leaves none of their entries zero.
    turn = np.linalg.qr(random.standard_normal((n, n)))[0] if seed % 3 else np.eye(n)
    elements = turn @ finite_group(GROUPS[name]).elements @ turn.T
    matrix = commuting(elements, random)
    scales = random_scales(random, n)
    group = finite_group(in_units(turn @ GROUPS[name] @ turn.T, scales))
    blocks = isotypic(group)
    here = in_units(matrix, scales)
    assert farthest(spectrum_of(blocks, here), np.linalg.eigvals(matrix)) < eigenvalue_error(matrix)
    assert commutes(group, here) < 1.0


@pytest.mark.parametrize("name", ["D5, 2 states", "S4"])
def test_modes_are_eigenvectors(name):
    random = np.random.default_rng(4)
    n = GROUPS[name].shape[1]
    scales = random_scales(random, n)
    group = finite_group(in_units(GROUPS[name], scales))
    matrix = commuting(finite_group(GROUPS[name]).elements, random)
    for block in isotypic(group):
        values, vectors = np.linalg.eig(block.reduced(in_units(matrix, scales)))
        for value, vector in zip(values, vectors.T, strict=True):
            mode = block.mode(vector, random.standard_normal(block.dimension)) / scales
            np.testing.assert_allclose(matrix @ mode, value * mode, atol=1e-11 * np.abs(mode).max())


def test_a_block_does_not_see_what_does_not_commute_and_bounds_its_error():
    random = np.random.default_rng(5)
    group = finite_group(GROUPS["D5, 2 states"])
    matrix = commuting(group.elements, random)
    disturbance = 1e-3 * random.uniform(-1.0, 1.0, matrix.shape)
    mean = np.mean(group.elements @ disturbance @ np.linalg.inv(group.elements), axis=0)
    for block in isotypic(group):
        disturbed = block.reduced(matrix + disturbance)
        np.testing.assert_allclose(disturbed, block.reduced(matrix + mean), atol=1e-14)
        moved = np.abs(disturbed - block.reduced(matrix))
        assert (moved <= block.reduced_error(matrix, 1e-3)).all()
        assert (block.reduced_error(matrix, 1e-3) <= 1e-2).all()
    assert commutes(group, matrix + disturbance) > 1.0
    assert commutes(group, matrix + disturbance, error=1e-3) <= 1.0


def test_many_matrices_at_once():
    random = np.random.default_rng(6)
    group = finite_group(GROUPS["C5, 2 states"])
    block = isotypic(group)[-1]
    matrices = np.array([commuting(group.elements, random) for _ in range(4)])
    many = block.reduced(matrices)
    assert many.shape == (4, 4, 4)
    np.testing.assert_array_equal(many[2], block.reduced(matrices[2]))


def test_positions_relative_to_a_first_cell():
    # The first one, and the others minus it: triangular matrices, not orthogonal in any units.
    relative = np.eye(5) - np.outer([0, 1, 1, 1, 1], [1, 0, 0, 0, 0])
    scales = np.array([1e4, 1e-4, 1e-2, 1.0, 1e3])
    generators = in_units(relative @ dihedral(5) @ np.linalg.inv(relative), scales)
    group = finite_group(generators)
    ring = np.roll(np.eye(5), 1, axis=0)
    matrix = in_units(relative @ (0.3 * ring + 0.3 * ring.T + 0.1 * np.eye(5)) @ np.linalg.inv(relative), scales)
    known = [0.1 + 0.6 * math.cos(2.0 * math.pi * k / 5) for k in range(5)]
    assert farthest(spectrum_of(isotypic(group), matrix), known) < 1e-14
    assert commutes(group, matrix) < 1.0


def test_generators_that_are_not_needed():
    every = finite_group(GROUPS["S4, regular"]).elements
    group = finite_group(every)
    assert group.order == 24
    assert len(group.generators) < 5
    assert finite_group([np.eye(2), np.eye(2)]).generators.shape == (1, 2, 2)


def test_results_are_the_same_every_time():
    one, other = (isotypic(finite_group(GROUPS["S4, regular"])) for _ in range(2))
    for first, second in zip(one, other, strict=True):
        np.testing.assert_array_equal(first.basis, second.basis)


def test_isotropy_of_states_in_any_units():
    scales = random_scales(np.random.default_rng(7), 10)
    group = finite_group(in_units(dihedral(5, 2), scales))
    everywhere = scales * np.tile([0.3, -1.2], 5)
    mirrored = scales * np.kron([1.0, 2.0, 3.0, 3.0, 2.0], [1.0, 0.5])
    assert isotropy(group, everywhere).order == 10
    assert isotropy(group, mirrored).order == 2
    assert isotropy(group, scales * np.arange(10.0)).order == 1
    two = isotropy(group, mirrored)
    assert shapes(two.generators) == [(1, "real", 6, 2), (1, "real", 4, 1)]
    # A state at rest, up to the error of its computation.
    tiny = 1e-14 * scales * np.arange(10.0)
    assert isotropy(group, tiny).order == 1
    assert isotropy(group, tiny, error=2e-13 * scales).order == 10


def test_centraliser_of_the_spatial_part_of_a_symmetry_in_time():
    group = finite_group(dihedral(6))
    assert centraliser(group, shift(6)).order == 6
    assert centraliser(group, reversal(6)).order == 4
    assert centraliser(group, -np.eye(6)).order == 12
    # Twisted: M = gamma Phi, Phi commuting with the group, commutes with the centraliser and not with the rest.
    random = np.random.default_rng(8)
    matrix = shift(6) @ commuting(group.elements, random)
    assert commutes(centraliser(group, shift(6)), matrix) < 1.0
    assert commutes(group, matrix) > 1e6


def crossing(generators, critical, number=-1):
    return symmetric_crossing(isotypic(finite_group(generators))[number], critical)


@pytest.mark.parametrize(
    ("generators", "kind", "quadratic", "axial"),
    [
        (np.eye(2)[None], SymmetricKind.SYMMETRY_KEPT, 1, {(1, False)}),
        (-np.eye(1)[None], SymmetricKind.PITCHFORK, 0, {(1, True)}),
        (dihedral(3), SymmetricKind.EQUIVARIANT_TRANSCRITICAL, 1, {(2, False)}),
        (dihedral(4), SymmetricKind.EQUIVARIANT_PITCHFORK, 0, {(2, True)}),
        (dihedral(5), SymmetricKind.EQUIVARIANT_PITCHFORK, 0, {(2, False)}),
        (dihedral(6), SymmetricKind.EQUIVARIANT_PITCHFORK, 0, {(2, True)}),
        # Cube: axes through faces, corners and edges. Tetrahedron: without edges, and with the term (yz, zx, xy).
        (GROUPS["O"], SymmetricKind.EQUIVARIANT_PITCHFORK, 0, {(4, True), (3, True), (2, True)}),
        (GROUPS["Oh"], SymmetricKind.EQUIVARIANT_PITCHFORK, 0, {(8, True), (6, True), (4, True)}),
        (GROUPS["T"], SymmetricKind.EQUIVARIANT_TRANSCRITICAL, 1, {(3, False), (2, True)}),
        (GROUPS["Td"], SymmetricKind.EQUIVARIANT_TRANSCRITICAL, 1, {(6, False), (4, True)}),
        # Clusters of 1 and 3, and of 2 and 2 (Golubitsky & Stewart, The Symmetry Perspective, Birkhäuser 2002).
        (GROUPS["S4"], SymmetricKind.EQUIVARIANT_TRANSCRITICAL, 1, {(6, False), (4, True)}),
    ],
)
def test_crossing_at_plus_one(generators, kind, quadratic, axial):
    found = crossing(generators, CircleEvent.PLUS)
    assert found.kind is kind
    assert found.quadratic == quadratic
    assert found.complete
    assert {(branch.isotropy.size, branch.reversed) for branch in found.branches} == axial


@pytest.mark.parametrize("cells", range(3, 13))
def test_dihedral_axes(cells):
    faithful = [block for block in isotypic(finite_group(dihedral(cells))) if block.kernel.sum() == 1][-1]
    assert len(symmetric_crossing(faithful, CircleEvent.PLUS).branches) == (1 if cells % 2 else 2)


def test_isotropy_of_axial_branches_is_what_the_modes_keep():
    group = finite_group(GROUPS["S4"])
    block = isotypic(group)[-1]
    for branch in symmetric_crossing(block, CircleEvent.PLUS).branches:
        mode = block.mode([1.0], branch.direction)
        assert np.abs(mode.imag).max() == 0.0
        kept = np.abs(group.elements @ mode - mode).max(axis=1) < 1e-12
        np.testing.assert_array_equal(np.flatnonzero(kept), branch.isotropy)
        assert isotropy(group, mode.real, error=1e-13).order == branch.isotropy.size


def test_no_lines_are_looked_for_at_a_pair():
    found = crossing(cyclic(5), CircleEvent.PAIR)
    assert found.kind is SymmetricKind.SYMMETRIC_NEIMARK_SACKER
    assert found.branches == ()


def test_period_doubling_has_no_quadratic_terms_and_keeps_shifts_by_the_old_period():
    assert crossing(np.eye(1)[None], CircleEvent.MINUS).kind is SymmetricKind.SYMMETRY_KEPT
    found = crossing(dihedral(3), CircleEvent.MINUS)
    assert found.kind is SymmetricKind.SYMMETRIC_PERIOD_DOUBLING
    assert found.quadratic == 0
    # A mirror keeps the orbits, or does so together with the shift.
    block = isotypic(finite_group(dihedral(3)))[-1]
    signs = [branch.direction @ block.representation[branch.isotropy] @ branch.direction for branch in found.branches]
    np.testing.assert_allclose(sorted(map(sorted, signs)), [[-1.0, 1.0], [1.0, 1.0]], atol=1e-12)


def turn(angle):
    return [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]


@pytest.mark.parametrize(
    ("generators", "words"),
    [
        ([[[1, 1], [0, 1]]], "infinite"),
        ([turn(1.0)], "infinite"),
        ([turn(2.0 * math.pi / 10_001)], "infinite"),
        ([[[1, 0], [0, -1]], [[math.cos(2), math.sin(2)], [math.sin(2), -math.cos(2)]]], "infinite"),
        (np.stack([permutation(1, 0, *range(2, 8)), permutation(*range(1, 8), 0)]), "10000"),
        ([[[2, 0], [0, 2]]], "infinite"),
        ([[[1e200, 0], [0, 1e-200]]], "infinite"),
        ([[[0, 0], [0, 0]]], "invertible"),
        ([[[1, 1], [1, 1]]], "invertible"),
        ([[1, 0], [0, 1]], "square"),
        ([[[1, 0, 0], [0, 1, 0]]], "square"),
        ([], "square"),
        ([np.eye(2), np.eye(3)], "square"),
        ([[[1]]] * 501, "1 to 500"),
        ([np.roll(np.eye(600), 1, axis=0)], "93"),
        ([[[math.nan]]], "finite"),
        ([[[1j]]], "real"),
        ("shift", "real"),
        (None, "real"),
    ],
)
def test_what_generates_no_finite_group_is_refused_in_one_line(generators, words):
    with pytest.raises(ParameterError) as error:
        finite_group(generators)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("gamma", "words"), [(np.zeros((4, 4)), "invertible"), (np.diag([1, 2, 3, 4]), "normalise")])
def test_symmetries_in_time_that_do_not_fit_the_group_are_refused_in_one_line(gamma, words):
    with pytest.raises(ParameterError, match=words) as error:
        centraliser(finite_group(dihedral(4)), gamma)
    assert "\n" not in str(error.value)


def test_a_state_at_the_edge_of_what_is_told_apart():
    # Two shifts by one cell stay within the error, three do not: no group.
    with pytest.raises(AnalysisError, match="do not form a group"):
        isotropy(finite_group(cyclic(12)), np.sin(2.0 * math.pi * np.arange(12) / 12), error=0.4)
