"""The campaign of random branches finds faults that are planted, and what it says of some branches."""

from dataclasses import replace
from random import Random

import numpy as np
import pytest

import branch_checks as checks
import branch_kinds as kinds
import branches
import own_flow as own
from chilopod.stability import Kind
from own_orbits import Crossing


def resonance(**options):
    """A bent resonance, with two folds, and its branch."""
    terms = (
        own.Term(0, 1.0, (0, 1)), own.Term(1, -0.1, (0, 1)), own.Term(1, -1.0, (1, 0)), own.Term(1, -1.0, (3, 0)),
        own.Term(1, 0.0, (0, 0), 1.0, 1.8),
    )  # fmt: skip
    asked = kinds.Drawn(
        own.Terms(2, terms, 2 * np.pi / 1.8), (0.2, 1.5), 0.2, True, np.array([0.0, 0.0]), options=options
    )
    return asked, branches.branch_of(asked)[0]


@pytest.fixture(scope="module")
def followed():
    return resonance()


@pytest.fixture(scope="module")
def begun():
    """To behind the first fold."""
    return resonance(points=20)


def faults(asked, branch):
    return [said.split(":")[0] for said in checks.checked(asked, branch).faults]


def with_point(branch, number, **other):
    points = list(branch.points)
    points[number] = replace(points[number], **other)
    return replace(branch, points=tuple(points))


def test_a_branch_is_right(followed):
    asked, branch = followed
    found = checks.checked(asked, branch)
    assert found.faults == found.own == []
    assert found.counts["confirmed"] == len(branch.special_points) == 2


def test_the_beginning_of_a_branch_is_right(begun):
    assert faults(*begun) == []
    assert len(begun[1].special_points) == 1


def test_a_branch_may_turn_in_the_pitchfork_where_it_leaves():
    fold, crossing = Crossing(0, 0.75, 1e-9, 0.5, True), Crossing(0, 0.75 + 2e-9, 1e-9, 0.5)
    pair, apart = Crossing(2, 0.75, 1e-9, 0.5), Crossing(0, 0.76, 1e-9, 0.6)
    for mine, other in ((fold, crossing), (crossing, fold)):
        assert checks.at_once(mine, [pair, other, apart], 1e-12) == (crossing, [pair, apart])
    assert checks.at_once(fold, [apart], 1e-12) == (fold, [apart])


def left_out(branch, at):
    return replace(branch, points=branch.points[:at] + branch.points[at + 1 :])


def invented(branch, at):
    point, (a, b) = branch.points[at], branch.points[1:3]
    new = replace(point, value=0.5 * (a.value + b.value), orbit=0.5 * (a.orbit + b.orbit))
    return replace(branch, points=(*branch.points[:2], new, *branch.points[2:]))


@pytest.mark.parametrize(
    ("plant", "found"),
    [
        (left_out, ["missed"]),
        (lambda branch, at: with_point(branch, at, value=branch.points[at].value + 3e-9), ["off"]),
        (lambda branch, at: with_point(branch, at, special=Kind.TRANSCRITICAL), ["kind"]),
        (invented, ["not there"]),
        (
            lambda branch, at: with_point(branch, 2, multipliers=branch.points[2].multipliers * (1.0 + 1e-8)),
            ["multipliers"],
        ),
        (lambda branch, at: with_point(branch, 2, orbit=branch.points[2].orbit * (1.0 + 1e-8)), "not closed"),
    ],
)
def test_a_planted_fault_is_found(begun, plant, found):
    """As the only one, or beside others that follow from it."""
    asked, branch = begun
    at = next(i for i, point in enumerate(branch.points) if point.special is not None)
    said = faults(asked, plant(branch, at))
    assert said == found or found in said


def test_a_branch_that_ends_too_early_is_found(followed):
    asked, branch = followed
    assert "end" in faults(asked, replace(branch, points=branch.points[:-1]))


@pytest.mark.parametrize("kind", ["hybrid", "piecewise", "symmetric", "relaxation"])
def test_random_branches(kind):
    assert branches.followed(kind, Random(f"7 {kind} 1"))["faults"] == []
