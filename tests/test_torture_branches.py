"""The campaign of random branches finds faults that are planted, and what it says of some branches."""

from dataclasses import replace
from random import Random

import numpy as np
import pytest

import branch_checks as checks
import branch_kinds as kinds
import branches
import own_flow as own


@pytest.fixture(scope="module")
def followed():
    """A bent resonance, with two folds."""
    terms = (
        own.Term(0, 1.0, (0, 1)),
        own.Term(1, -0.1, (0, 1)),
        own.Term(1, -1.0, (1, 0)),
        own.Term(1, -1.0, (3, 0)),
        own.Term(1, 0.0, (0, 0), 1.0, 1.8),
    )
    asked = kinds.Drawn(own.Terms(2, terms, 2 * np.pi / 1.8), (0.2, 1.5), 0.2, True, np.array([0.0, 0.0]))
    return asked, branches.branch_of(asked)[0]


def faults(asked, branch):
    return [said.split(":")[0] for said in checks.checked(asked, branch).faults]


def with_point(branch, number, **other):
    points = list(branch.points)
    points[number] = replace(points[number], **other)
    return replace(branch, points=tuple(points))


def special(branch):
    return next(i for i, point in enumerate(branch.points) if point.special is not None)


def test_a_branch_is_right(followed):
    asked, branch = followed
    found = checks.checked(asked, branch)
    assert found.faults == found.own == []
    assert found.counts["confirmed"] == len(branch.special_points) == 2


def test_a_point_that_is_left_out_is_missed(followed):
    asked, branch = followed
    at = special(branch)
    assert faults(asked, replace(branch, points=branch.points[:at] + branch.points[at + 1 :])) == ["missed"]


def test_a_point_beside_its_place_is_off(followed):
    asked, branch = followed
    at = special(branch)
    value = branch.points[at].value + 3e-9
    assert faults(asked, with_point(branch, at, value=value)) == ["off"]


def test_a_point_of_another_kind(followed):
    from chilopod.stability import Kind

    asked, branch = followed
    assert faults(asked, with_point(branch, special(branch), special=Kind.TRANSCRITICAL)) == ["kind"]


def test_a_point_that_is_invented(followed):
    asked, branch = followed
    at = special(branch)
    point, (a, b) = branch.points[at], branch.points[1:3]
    new = replace(point, value=0.5 * (a.value + b.value), orbit=0.5 * (a.orbit + b.orbit))
    assert faults(asked, replace(branch, points=(*branch.points[:2], new, *branch.points[2:]))) == ["not there"]


def test_an_orbit_that_does_not_close(followed):
    asked, branch = followed
    assert "not closed" in faults(asked, with_point(branch, 2, orbit=branch.points[2].orbit * (1.0 + 1e-8)))


def test_a_multiplier_that_is_wrong(followed):
    asked, branch = followed
    assert faults(asked, with_point(branch, 2, multipliers=branch.points[2].multipliers * (1.0 + 1e-8))) == [
        "multipliers"
    ]


def test_an_end_that_is_not_true(followed):
    asked, branch = followed
    assert "end" in faults(asked, replace(branch, points=branch.points[:-1]))


@pytest.mark.parametrize("kind", ["hybrid", "piecewise", "symmetric", "relaxation"])
def test_random_branches(kind):
    assert branches.followed(kind, Random(f"7 {kind} 1"))["faults"] == []
