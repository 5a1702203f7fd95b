"""Families of matrices that nobody can analyse: every search ends within its budget and says what it is worth."""

import numpy as np
import pytest

from chilopod.errors import AnalysisError
from chilopod.stability.unit_circle.crossings import SearchStatus, find_crossings

BUDGET = 600
HARM = ("rough", "jumps", "holes", "noise", "refused", "spike", "constant", "ever faster", "infinite", "flat", "huge")


def hostile(seed):
    """A family with one to three kinds of harm done to it, on a parameter of any scale; how often it was asked."""
    rng = np.random.default_rng(seed)
    size = rng.integers(1, 7)
    scale = 10.0 ** rng.choice([-300, -12, 0, 0, 9, 300])
    low = rng.choice([0.0, -0.5, 0.01]) * scale
    a, b = rng.normal(size=(2, size, size)) / np.sqrt(size)
    harm = rng.choice(HARM, size=rng.integers(1, 4), replace=False)
    frequency, noise, places = rng.uniform(1.0, 30.0), 10.0 ** rng.uniform(-16.0, 0.0), rng.random(3)
    power = rng.choice([-280, 280])
    asked = set()

    def matrices(values):
        t = values / scale - low / scale
        if "refused" in harm and ((t > places[0]) & (t < places[0] + 0.1)).any():
            raise AnalysisError("the orbit is lost")
        asked.update(values.tolist())
        shift = np.zeros_like(t)
        if "rough" in harm:
            shift += sum(0.7**k * np.cos(3.0**k * np.pi * t) for k in range(20))
        if "jumps" in harm:
            shift += np.where(t > places[1], 0.5, -0.3) + 0.1 * np.floor(5.0 * t)
        if "spike" in harm:
            shift += 3.0 * np.exp(-(((t - places[2]) / 1e-3) ** 2))
        if "ever faster" in harm:
            shift += np.sin(1.0 / (np.abs(t - places[2]) + 1e-9))
        found = a * np.cos(frequency * t)[:, None, None] + b + shift[:, None, None] * np.eye(size)
        if "constant" in harm:
            found = np.broadcast_to((1.0 if seed % 2 else -1.0) * np.eye(size), found.shape)
        if "flat" in harm:
            found = np.where((t < 0.5)[:, None, None], found, np.eye(size))
        if "noise" in harm:
            found = found * (1.0 + noise * np.sin(1e9 * t[:, None, None] + np.arange(size * size).reshape(size, size)))
        if "holes" in harm:
            found = np.where((np.sin(40.0 * t) > 0.9)[:, None, None], np.nan, found)
        if "infinite" in harm:
            found = np.where((np.abs(t - places[0]) < 0.01)[:, None, None], np.inf, found)
        if "huge" in harm:
            found = found * 10.0**power
        return found, np.full(values.size, noise if seed % 3 else 1e-15)

    return matrices, low, low + scale, asked


@pytest.mark.parametrize("seed", range(40))
def test_every_search_ends_within_its_budget(seed):
    matrices, low, high, asked = hostile(seed)
    found = find_crossings(matrices, low, high, budget=BUDGET)
    assert found.evaluations <= BUDGET
    assert len(asked) <= BUDGET
    assert all(low <= c.bracket[0] <= c.value <= c.bracket[1] <= high for c in found.crossings)
    assert list(found.crossings) == sorted(found.crossings, key=lambda c: c.value)
    assert all("\n" not in remark for remark in found.remarks)


def scalar(function):
    return lambda values: (function(values)[:, None, None], np.full(values.size, 1e-16))


def test_a_jump_across_the_circle_is_no_crossing():
    found = find_crossings(scalar(lambda p: np.where(p < 0.3, 0.9, 1.2) + 0.0 * p), 0.0, 1.0)
    assert (found.status, found.crossings) == (SearchStatus.INCOMPLETE, ())
    assert any("jumps across the circle at 0.3" in remark for remark in found.remarks)


def test_a_jump_at_zero_is_no_crossing():
    """At zero the root finder's bracket shrinks without end: the multiplier seemed to be within it on the circle."""
    found = find_crossings(scalar(lambda p: np.where(p < 0.0, 0.549, -1.369)), -1.1276, 0.7144)
    assert (found.status, found.crossings) == (SearchStatus.INCOMPLETE, ())
    (said,) = (remark for remark in found.remarks if "jumps" in remark)
    assert abs(float(said.split(", ")[0].split()[-1])) < 1e-15
    assert found.evaluations < 800


def test_what_lies_in_a_hole_is_not_claimed():
    def matrices(values):
        if ((values > 0.4) & (values < 0.5)).any():
            raise AnalysisError("the orbit is lost")
        return np.exp((values - 0.45) * (values - 0.8))[:, None, None], np.full(values.size, 1e-16)

    found = find_crossings(matrices, 0.0, 1.0)
    assert found.status is SearchStatus.INCOMPLETE
    assert [(c.value, c.change) for c in found.crossings] == [(pytest.approx(0.8), 1)]
    assert any("-1 multipliers outside, and no matrices in between" in remark for remark in found.remarks)


def test_nothing_anywhere_is_said():
    found = find_crossings(scalar(lambda p: np.full(p.size, np.nan)), 0.0, 1.0)
    assert (found.status, found.remarks) == (SearchStatus.INCOMPLETE, ("there is no matrix anywhere",))


def test_a_spent_budget_keeps_what_was_found():
    found = find_crossings(scalar(lambda p: 1.0 + np.sin(300.0 * p)), 0.0, 1.0, budget=300)
    assert found.status is SearchStatus.BUDGET
    assert found.evaluations <= 300
    assert found.crossings
    assert np.sin([300.0 * c.value for c in found.crossings]) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("budget", [76, 88, 112, 144, 156, 172])
def test_a_crossing_that_the_budget_leaves_unfinished_is_no_jump(budget):
    found = find_crossings(scalar(lambda p: 1.0 + 0.3 * np.sin(40.0 * p)), 0.0, 1.0, budget=budget)
    assert found.status is SearchStatus.BUDGET
    assert not any("jumps" in remark for remark in found.remarks)
    for crossing in found.crossings:
        assert crossing.value == pytest.approx(np.pi / 40.0 * round(crossing.value * 40.0 / np.pi), abs=1e-12)
