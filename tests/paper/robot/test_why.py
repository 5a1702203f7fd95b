import numpy as np
import pytest

from chilopod import load_robot
from chilopod.analysis.straight_walk import pitchfork
from chilopod.paper.robot import why as ablation
from chilopod.paper.robot.why import FACTORS, FINER, limit_point, planar_limit, sign_change, with_factors, with_grip
from chilopod.paper.section import Size
from chilopod.twin import foot_creep

ROBOT, PLANAR = load_robot("aoi2022"), load_robot("aoi2022-planar")


def test_sign_change_is_the_stiffest_and_linear_in_the_inverse():
    springs = np.array([10.0, 12.0, 15.0, 20.0, 30.0])
    assert sign_change(springs, 1.0 / springs - 1.0 / 14.0) == pytest.approx(14.0)
    assert sign_change(springs, np.array([1.0, -1.0, 1.0, -1.0, -1.0])) == pytest.approx(1.0 / (0.5 / 15 + 0.5 / 20))
    assert np.isnan(sign_change(springs, -np.ones(5)))


@pytest.mark.slow
def test_the_two_engines_vouch_for_each_other(kept):
    """The planar limit of the twin loses the straight walk where the planar model does, within 3 %; the walks are those
    of the tiny report."""
    limit = planar_limit(ROBOT, PLANAR, FINER)
    assert foot_creep(limit).across == pytest.approx(PLANAR.ground.friction, rel=1e-3)
    assert limit_point(ROBOT, PLANAR, ablation.PLANAR, kept, 12.0) == pytest.approx(
        pitchfork(PLANAR, normal_form=False).value, rel=0.03
    )


def test_factors_take_every_constant_from_the_limit_to_the_twin():
    every = with_factors(ROBOT, PLANAR, [factor.name for factor in FACTORS])
    for factor in FACTORS:
        for path in factor.paths:
            assert every.get(path) == ROBOT.get(path)
    # Proportion holds up to 0.1 % over a factor of twenty.
    assert foot_creep(every).across == pytest.approx(foot_creep(ROBOT).across, rel=5e-3)
    none = with_factors(ROBOT, PLANAR, [])
    assert none == planar_limit(ROBOT, PLANAR)
    soft = with_factors(ROBOT, PLANAR, ["soft legs"])
    assert soft.get("twin.servo_stiffness") == ROBOT.get("twin.servo_stiffness")
    assert soft.get("twin.clearance") == none.get("twin.clearance")


def test_creep_is_in_proportion_to_the_impedance_ratio():
    once = foot_creep(ROBOT)
    assert once.along == pytest.approx(once.across, rel=0.02)
    assert foot_creep(with_grip(ROBOT, 3000.0)).across == pytest.approx(3000.0, rel=1e-3)
    assert once.speed(1.0) == 1.0 / once.across


def test_points_that_are_not_there_are_said_to_be(monkeypatch):
    def curving_below(spring):
        return lambda robot, springs, duration, folder: 0.3 * np.sqrt(np.maximum(spring / np.array(springs) - 1.0, 0.0))

    monkeypatch.setattr(ablation, "_bends", curving_below(27.0))
    assert ablation.onset(ROBOT) == pytest.approx(27.0, rel=1e-3)
    assert ablation.onset(ROBOT, size=Size.QUICK) == pytest.approx(27.0, rel=1e-3)
    monkeypatch.setattr(ablation, "_bends", curving_below(500.0))
    assert ablation.onset(ROBOT) == np.inf
    monkeypatch.setattr(ablation, "_bends", curving_below(5.0))
    assert np.isnan(ablation.onset(ROBOT))
