"""Stability of the straight walk and its bifurcations, in the robot's own terms."""

from contextlib import nullcontext

import numpy as np
import pytest

from chilopod import stability
from chilopod.analysis import bifurcations, first_loss, straight_walk
from chilopod.analysis.parameters import ALL, K1, stiffness
from chilopod.analysis.straight_walk import family
from chilopod.errors import AnalysisError, ParameterError
from chilopod.planar import PlanarModel
from chilopod.robot import load_robot
from chilopod.stability import Kind, spectrum

ROBOT = load_robot("aoi2022-planar")


def test_a_loss_of_another_kind_is_said():
    with pytest.raises(AnalysisError, match="Neimark-Sacker"):
        first_loss(ROBOT, ALL, (stiffness(2.0), stiffness(75.0)), Kind.PITCHFORK)


def test_a_pitchfork_of_a_walk_that_is_unstable_anyway_is_no_loss():
    """With soft springs an oscillation grows on both sides of it."""
    soft = ROBOT.with_value(ALL, stiffness(3.0))
    with pytest.raises(AnalysisError, match="the straight walk above the pitchfork is unstable"):
        first_loss(soft, K1, (stiffness(0.5), stiffness(9.0)), Kind.PITCHFORK, normal_form=False)


def test_coefficients_are_those_of_the_joint_angles():
    (point,) = bifurcations(ROBOT, K1, (stiffness(11.0), stiffness(13.0)))
    share = np.linalg.norm(point.point.mode[3:8])
    assert point.coefficient == pytest.approx(point.point.coefficient / share**2)
    assert np.linalg.norm(point.joint_components) == pytest.approx(1.0)
    assert point.error_bound < 1e-8


def test_only_continuous_numbers_that_the_model_reads_are_parameters():
    with pytest.raises(ParameterError, match=r"body\.modules.*continuous"):
        bifurcations(ROBOT, "body.modules", (3.0, 8.0))
    robot = load_robot("aoi2022").set_from_text(["body.yaw_inertia=0.02", "twin.timestep=0.0005"])
    for path in set(robot.parameters()) - {"body.modules"}:
        both = [PlanarModel(each) for each in (robot, robot.with_value(path, 0.5 * robot.get(path) or 0.1))]
        data = [(m.scalars, m.stiffness, m.damping, m.moments(np.arange(3)), m.schedule.times) for m in both]
        with (
            nullcontext()
            if not all(map(np.array_equal, *data))
            else pytest.raises(ParameterError, match="that the planar model reads")
        ):
            family(robot, path)


def test_stability_agrees_with_the_sign_of_the_leading_exponent():
    for k1 in (11.0, 13.0):
        found = straight_walk(ROBOT.with_value(K1, stiffness(k1)))
        assert found.stable is bool(found.exponents.values[0].real < 0) == (k1 > 12)


def test_long_chains_are_refused_before_the_work_and_short_ones_are_not(monkeypatch):
    """Hours are refused, by what a chain of fewer modules takes; minutes are not."""
    asked = []
    contraction = PlanarModel.contraction.fget
    monkeypatch.setattr(
        PlanarModel, "contraction", property(lambda model: asked.append(model.modules) or contraction(model))
    )
    with pytest.raises(AnalysisError, match=r"body\.modules = 1000.*hours: 2001 states.*about 60 minutes"):
        straight_walk(ROBOT.with_value("body.modules", 1000))
    assert asked == [100]
    monkeypatch.setattr(stability, "exponents", lambda model, **_: (_ for _ in ()).throw(InterruptedError))
    with pytest.raises(InterruptedError):  # it begins
        straight_walk(ROBOT.with_value("body.modules", 30))
    with pytest.raises(AnalysisError, match=r"2\.49 minutes"):
        straight_walk(ROBOT.with_value("body.modules", 30), longest=60.0)


SIDES_ALIKE = [
    *("body.modules=8", "springs.damping[1]=0.3 N*m*s/rad", "springs.damping[2]=0.5 N*m*s/rad"),
    *("gait.side_phase=0 deg", "body.length=0.53 m", "gait.stance=0.42 s", "gait.swing=0.84 s"),
    *("ground.friction=1350 N*s/m", "gait.stride=24 mm", "gait.module_phase=300 deg", "legs.half_width=18 mm"),
    "legs.forward_offset=0 mm",
]
UNEVEN = [
    *("body.modules=8", "body.length=8.6 m", "body.mass=0.16 kg", "springs.damping[2]=3 N*m*s/rad"),
    *("springs.damping[3]=5 N*m*s/rad", "springs.damping[4]=4 N*m*s/rad", "springs.damping[5]=2 N*m*s/rad"),
    *("springs.damping[6]=0 N*m*s/rad", "gait.swing=10 ms", "ground.friction=27 N*s/m", "gait.stride=58 cm"),
]


def test_a_robot_whose_fastest_modes_are_barely_resolved_is_stable():  # on some processors they are not
    assert straight_walk(load_robot("aoi2022-planar").set_from_text(SIDES_ALIKE)).stable


def test_modes_that_die_out_fast_are_found():
    """By QR of 4000 parts of the period, computed apart: the fastest, the slowest fast one, and the mean divergence."""
    exponents = straight_walk(load_robot("aoi2022-planar").set_from_text(UNEVEN)).exponents.values
    assert len(exponents) == 17
    rates = np.sort(exponents.real)
    np.testing.assert_allclose([rates[0], rates[9], rates.sum()], [-7369.525, -1032.012, -29254.967], atol=2e-3)


@pytest.mark.parametrize(("springs", "stable"), [(["springs.stiffness=75 N*mm/deg"], True), ([], False)])
def test_modes_that_die_out_too_fast_do_not_hide_the_others(springs, stable, monkeypatch):
    monkeypatch.setattr(spectrum, "_MOST", 2000)  # parts of the period; a sixteenth, which refuses sooner
    robot = load_robot("aoi2022-planar").set_from_text([*UNEVEN, "body.mass=1 g", *springs])
    found = straight_walk(robot)
    assert found.stable is stable
    assert 0 < len(found.exponents.values) < found.exponents.multipliers.values.size
    assert np.isfinite(found.exponents.values).all()
    leading = found.exponents.multipliers.values[: len(found.moduli)]
    np.testing.assert_allclose(found.moduli, np.abs(leading), rtol=1e-6)
    assert "modes that die out faster are not resolved" in "\n".join(found.lines())
    with pytest.raises(AnalysisError, match="contracts too strongly"):
        stability.exponents(PlanarModel(robot))
