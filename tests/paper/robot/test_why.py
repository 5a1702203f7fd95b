"""Parts of the assumptions of the planar model: the game by hand and by orders, the search, and the two engines."""

import itertools
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot
from chilopod.analysis.parameters import K1, stiffness
from chilopod.analysis.straight_walk import pitchfork
from chilopod.paper import measures
from chilopod.paper.robot import why
from chilopod.paper.robot.figures import trust
from chilopod.paper.robot.why import FACTORS, PLANAR, limit_end, planar_limit, shapley, with_factors, with_grip
from chilopod.paper.section import Context, Size
from chilopod.twin import foot_creep

ROBOT, FLAT = load_robot("aoi2022"), load_robot("aoi2022-planar")
ON = why.subsets(Size.FULL)


def test_parts_are_the_means_over_all_orders():
    values = np.random.default_rng(0).normal(size=len(ON))
    game = dict(zip(map(tuple, ON.tolist()), values, strict=True))
    added = []
    for order in itertools.permutations(range(7)):
        steps = [game[tuple(factor in order[:i] for factor in range(7))] for i in range(8)]
        added.append(np.diff(steps)[np.argsort(order)])
    np.testing.assert_allclose(shapley(ON, values), np.mean(added, axis=0), rtol=0, atol=1e-12)
    for factor, each in enumerate(np.transpose(added)):
        # The middle 90 % of 5040 orders, of which many add the same.
        low, high = why.over_orders(ON, values, factor)
        assert 0.02 < (each < low).mean() <= 0.08
        assert 0.02 < (each > high).mean() <= 0.08


@pytest.mark.parametrize(("size", "count"), [(Size.FULL, 128), (Size.QUICK, 16)])
def test_parts_that_do_not_depend_on_the_order_are_found_from_few_subsets(size, count):
    parts, on = np.array([0.3, 0.8, -0.1, 0.0, 0.5, 0.2, -0.4]), why.subsets(size)
    assert len(on) == count
    ends = np.exp(np.stack([on @ parts + 2.5, on @ parts + 2.4, on @ parts + 2.6], axis=1))
    found = why.shares(on, ends)
    for name in ("share", "share_low", "share_high"):
        np.testing.assert_allclose(np.log(found[name]), parts, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.alone, np.exp(parts + 2.5))
    np.testing.assert_allclose(found.without, np.exp(parts.sum() + 2.5 - parts))


def test_two_factors_that_act_together_share_what_they_add():
    together = ON[:, 1] & ON[:, 4]
    found = why.shares(ON, np.exp(np.repeat(together[:, None] * np.log(4.0), 3, axis=1)))
    np.testing.assert_allclose(found.share[[1, 4, 0]], [2.0, 2.0, 1.0])
    assert float(found.share_low[1]) == pytest.approx(1.0)
    assert float(found.share_high[1]) == pytest.approx(4.0)


@pytest.fixture
def growing_below(monkeypatch):
    """A made-up walk that is stable above a spring."""

    def made_up(spring):
        def modes(cycle, start, yaw, cycles, basis):
            value = 1.0 + 0.08 * np.log(spring / cycle.spring)
            modes = [SimpleNamespace(multiplier=value * np.exp(0.2j), error=0.004)]
            return modes, np.zeros(5), None

        def cycle(robot):
            return SimpleNamespace(spring=robot.get(K1) / stiffness(1.0), names=[f"yaw{i}" for i in range(1, 6)]), None

        monkeypatch.setattr(why, "finite_modes", modes)
        monkeypatch.setattr(why, "walk_cycle", cycle)

    return made_up


def test_the_end_of_the_straight_walk_is_found_or_beyond_the_search(growing_below):
    growing_below(27.0)
    end = why.straight_end(ROBOT)
    assert end.value == pytest.approx(27.0, rel=0.02)
    # An error of 0.004 over a slope of 0.08 per e-fold.
    np.testing.assert_allclose([end.low, end.high], 27.0 * np.array([0.95, 1.05]), rtol=0.03)
    growing_below(500.0)
    assert vars(why.straight_end(ROBOT)) == {"value": 80.0, "low": 80.0, "high": np.inf}
    growing_below(2.0)
    assert vars(why.straight_end(ROBOT)) == {"value": 5.0, "low": 0.0, "high": 5.0}


def test_subsets_are_kept_as_they_end(growing_below, monkeypatch, tmp_path):
    growing_below(27.0)
    monkeypatch.setattr(why, "limit_end", lambda *given: 12.0)
    context = Context(size=Size.TINY, folder=tmp_path / "trials")
    found = why.contributions(context)
    assert len(list((tmp_path / "multipliers").iterdir())) == 2
    monkeypatch.setattr(why, "straight_end", lambda *given: pytest.fail("walks again"))
    assert why.contributions(context).identical(found)
    monkeypatch.setattr(measures, "digest", lambda without: "of edited sources")
    with pytest.raises(pytest.fail.Exception, match="walks again"):
        why.contributions(context)


def test_other_sets_of_the_valley_have_parts_of_their_own(growing_below, tmp_path):
    growing_below(27.0)
    context = Context(size=Size.TINY, folder=tmp_path / "trials")
    found = why.over_sets(context)
    assert found.sizes == {"set": 2, "subset": 2, "factor": len(FACTORS)}
    assert found.on.dims == ("subset", "factor")
    # Ends of the preset and of the other set are searched apart.
    assert len(list((tmp_path / "multipliers").iterdir())) == 4
    panel = trust.why_sets(found)
    assert panel.text[1].endswith("sets: nothing.")
    assert "or more" not in panel.text[0]
    beyond = trust.why_sets(found.assign(end=xr.full_like(found.end, 80.0)))
    assert "80.0\u00a0N·mm/deg or more" in beyond.text[0]
    raised = why.over_sets(context).assign(share=found.share + 0.5)
    assert "standing feet stick" in trust.why_sets(raised).text[1]


def test_the_cause_is_one_sentence_the_same_everywhere():
    """Readme, page and answers say what follows from the table of the parts in the docs."""
    root = Path(__file__).parents[3]
    lines = (root / "docs" / "twin-results.md").read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if line.startswith("| ") and "×" in line and " to " in line]
    assert len(rows) == len(FACTORS)
    cells = [[float(number) for number in re.findall(r"[\d.]+", line.split("|")[2])] for line in rows]
    share, low, high = np.array(cells).T
    data = why.shares(ON, np.ones((len(ON), 3))).assign_coords(factor=[factor.name for factor in FACTORS])
    said = why.cause(data.assign(share=("factor", share), share_low=("factor", low), share_high=("factor", high)))
    for file in ("README.md", "docs/twin-results.md"):
        assert said in " ".join((root / file).read_text(encoding="utf-8").split())


@pytest.mark.slow
def test_the_two_engines_vouch_for_each_other(kept):
    """The straight walk of the planar limit ends where that of the planar model does, within 3 %."""
    assert foot_creep(planar_limit(ROBOT, FLAT)).across == pytest.approx(FLAT.ground.friction, rel=1e-3)
    exact = pitchfork(FLAT, normal_form=False).value
    assert limit_end(ROBOT, FLAT, PLANAR, kept, 12) == pytest.approx(exact, rel=0.03)


def test_factors_take_every_constant_from_the_limit_to_the_twin():
    every = with_factors(ROBOT, FLAT, [factor.name for factor in FACTORS])
    for factor in FACTORS:
        for path in factor.paths:
            assert every.get(path) == ROBOT.get(path)
    # Proportion holds up to 0.1 % over a factor of twenty.
    assert foot_creep(every).across == pytest.approx(foot_creep(ROBOT).across, rel=5e-3)
    none = with_factors(ROBOT, FLAT, [])
    assert none == planar_limit(ROBOT, FLAT)
    soft = with_factors(ROBOT, FLAT, ["soft legs"])
    assert soft.get("twin.servo_stiffness") == ROBOT.get("twin.servo_stiffness")
    assert soft.get("twin.clearance") == none.get("twin.clearance")


def test_creep_is_in_proportion_to_the_impedance_ratio():
    once = foot_creep(ROBOT)
    assert once.along == pytest.approx(once.across, rel=0.02)
    assert foot_creep(with_grip(ROBOT, 3000.0)).across == pytest.approx(3000.0, rel=1e-3)
    assert once.speed(1.0) == 1.0 / once.across
