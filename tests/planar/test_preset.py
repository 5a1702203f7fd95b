"""The preset against the paper, former constants against other programs, points of any robot against a finer one."""

import math

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from chilopod import Robot, load_robot
from chilopod.analysis.map_axes import with_modules
from chilopod.paper.printed import critical_mode_data
from chilopod.planar import PlanarModel
from chilopod.stability import Criticality, Kind, exponents, locate, multipliers
from chilopod.units import parse
from helpers.planar_reference import EXTENDED, LD, PI, fine_flow
from helpers.planar_strategies import robots

PRESET = load_robot("aoi2022-planar")
UNIT = parse("1 N*mm/deg", "N*m/rad")


def points(robot, path="springs.stiffness[0]", between=(2.0, 75.0), **options):
    found = locate(lambda k: PlanarModel(robot.with_value(path, k)), (between[0] * UNIT, between[1] * UNIT), **options)
    for point in found:
        assert 0.0 < point.error_bound < 1e-9 * point.value
    return found


def only(found):
    assert len(found) == 1
    return found[0]


def test_the_paper_s_pitchfork():
    point = only(points(PRESET))
    printed = critical_mode_data()
    assert point.kind is Kind.PITCHFORK
    assert point.value == pytest.approx(printed.k1, abs=printed.k1_tolerance)
    assert point.frequency == 0.0
    assert point.criticality is Criticality.SUPERCRITICAL
    assert point.multiplier == pytest.approx(-1.0, abs=1e-10)
    joints = point.mode[3:8].real
    np.testing.assert_allclose(np.abs(point.mode.imag), 0.0)
    joints = joints / np.linalg.norm(joints)
    joints *= np.sign(joints[0])
    np.testing.assert_allclose(joints, printed.components, rtol=0, atol=printed.component_tolerance)


def test_the_pitchfork_with_the_former_constants(former):
    point = only(points(former, between=(11.0, 13.0)))
    assert point.value / UNIT == pytest.approx(12.00114549050763, rel=1e-13)
    joints = np.abs(point.mode[3:8]) / np.linalg.norm(point.mode[3:8])
    np.testing.assert_allclose(joints, [0.635, 0.358, 0.476, 0.465, 0.163], rtol=0, atol=1e-3)


@pytest.mark.parametrize(
    ("setting", "expected", "half_a_digit"),
    [
        ([f"springs.stiffness[{joint}]=28 N*mm/deg" for joint in range(1, 5)], 8.97, 0.005),
        (["gait.stride=1.8 cm"], 10.8, 0.05),
        (["gait.module_phase=180 deg"], 11.3, 0.05),
        (["gait.module_phase=-120 deg"], 11.79, 0.005),
        (7, 12.1, 0.05),
        (8, 12.0, 0.05),
        (9, 12.3, 0.05),
        (10, 12.5, 0.05),
    ],
    ids=["k2-5 = 28", "stride 1.8 cm", "phase pi", "phase -120 deg", "N = 7", "N = 8", "N = 9", "N = 10"],
)
def test_variants_of_the_pitchfork(former, setting, expected, half_a_digit):
    robot = with_modules(former, setting) if isinstance(setting, int) else former.set_from_text(setting)
    found = [point for point in points(robot, normal_form=False) if point.kind is Kind.PITCHFORK]
    assert found[-1].value / UNIT == pytest.approx(expected, abs=half_a_digit)


def test_uniform_springs_oscillate(former):
    point = points(former, "springs.stiffness")[-1]
    assert point.kind is Kind.NEIMARK_SACKER
    assert point.value / UNIT == pytest.approx(6.5756, abs=5e-5)
    assert point.frequency == pytest.approx(0.5767, abs=5e-5)


def test_half_and_full_period_find_the_same_point():
    half = only(points(PRESET, normal_form=False, between=(8.0, 20.0)))
    full = only(
        locate(
            lambda k: PlanarModel(PRESET.with_value("springs.stiffness[0]", k), use_symmetry=False),
            (8.0 * UNIT, 20.0 * UNIT),
            normal_form=False,
        )
    )
    assert abs(half.value - full.value) <= half.error_bound + full.error_bound


def test_all_thirteen_exponents_against_800_bits(former):
    robot = former.with_value("springs.stiffness", 41 * UNIT)
    values = exponents(PlanarModel(robot)).values
    known = [
        -0.229784358749284,
        -0.229784358749284,
        -1.56577438558143,
        -3.61521198058572,
        -4.63468409130133,
        -61.6362644914589,
        -127.678643241166,
        -187.533113156300,
        -198.922434791472,
        -231.848150252949,
        -286.225761933620,
        -350.704011544285,
        -455.651125308081,
    ]
    np.testing.assert_allclose(values.real, known, rtol=1e-9)
    assert values[0].imag > 0.0
    assert values[1] == np.conj(values[0])
    np.testing.assert_array_equal(values[2:].imag % (2 * math.pi / 0.6), 0.0)
    # Multipliers are their exponentials, as far as double can tell.
    found = multipliers(PlanarModel(robot))
    expected = np.exp(0.6 * values[:5])
    np.testing.assert_allclose(np.sort_complex(found.values[:5]), np.sort_complex(expected), rtol=1e-12)
    assert found.stable


# -- located points against extended precision


def determinant(a):
    """By elimination with pivoting, in the precision of its argument."""
    a, product = a.copy(), a.dtype.type(1)
    for k in range(len(a)):
        pivot = k + int(np.abs(a[k:, k]).argmax())
        if pivot != k:
            a[[k, pivot]] = a[[pivot, k]]
            product = -product
        product = product * a[k, k]
        a[k + 1 :, k:] -= np.outer(a[k + 1 :, k] / a[k, k], a[k, k:])
    return product


def finer_value(family, point):
    """The parameter near a located point at which the critical multiplier is on the unit circle, by Newton's method."""
    model = family(point.value)
    count = 1 if model.symmetry is None else 2
    identity = np.eye(model.dimension)

    def excess(k):
        flow = fine_flow(family(float(k)).robot, 0.0, model.period / count)
        if count == 2:
            flow = model.reflection.astype(LD) @ flow
        flow = flow.astype(np.clongdouble)
        return lambda angle: determinant(flow - identity * np.exp(np.clongdouble(1j) * angle))

    moved = LD(1.000001 * point.value) - LD(point.value)
    here, beside = excess(point.value), excess(1.000001 * point.value)
    if abs(point.multiplier.imag) < 1e-12:
        angle = LD(0) if point.multiplier.real > 0 else PI
        f = here(angle)
        return LD(point.value) - (f / ((beside(angle) - f) / moved)).real
    # A pair on the circle: two real equations for parameter and angle. The parameter moves by round-off only, so its
    # derivative serves all steps.
    angle, k = LD(np.angle(point.multiplier)), LD(0)
    by_k = (beside(angle) - here(angle)) / moved
    for _ in range(3):
        f = here(angle) + k * by_k
        by_angle = (here(angle + LD(1e-7)) - here(angle - LD(1e-7))) / LD(2e-7)
        area = (by_k.conjugate() * by_angle).imag
        k = k - (f * by_angle.conjugate()).imag / (by_k * by_angle.conjugate()).imag
        angle = angle - (by_k.conjugate() * f).imag / area
    return LD(point.value) + k


def check(family, between):
    """How many times the claimed bound exceeds the error, for each point."""
    margins = []
    for point in locate(family, between, normal_form=False):
        assert abs(point.multiplier) == pytest.approx(1.0, abs=1e-6)
        error = abs(float(finer_value(family, point) - LD(point.value)))
        assert error <= point.error_bound
        margins.append(point.error_bound / error if error else math.inf)
    return margins


def uniform_springs(robot):
    """The robot as a family in one stiffness for all joints, and an interval of it from slack to stiff."""
    inertia, period = robot.module_yaw_inertia, robot.gait.period
    between = (inertia * (3.0 / period) ** 2, inertia * (30.0 / period) ** 2)
    return lambda k: PlanarModel(robot.with_value("springs.stiffness", k)), between


# A counterexample takes minutes to shrink.
no_shrinking = [Phase.explicit, Phase.reuse, Phase.generate]


@pytest.mark.skipif(not EXTENDED, reason="this machine has no precision finer than double")
@settings(max_examples=5, deadline=None, phases=no_shrinking)
@given(robots(st.integers(3, 6)))
def test_located_points_lie_within_their_error_bound(robot):
    check(*uniform_springs(robot))


@pytest.mark.skipif(not EXTENDED, reason="this machine has no precision finer than double")
@settings(max_examples=10, deadline=None, phases=no_shrinking)
@given(
    st.integers(3, 12),
    st.floats(0.6, 1.6),
    st.floats(0.6, 1.6),
    st.floats(0.02, 0.06),
    st.sampled_from([120.0, 180.0, -120.0, 90.0, 77.0]),
    st.sampled_from([180.0, 180.0, 180.0, 150.0]),
)
def test_located_points_near_the_paper_s_robot_lie_within_their_error_bound(n, c, b, x0, phase, side):
    robot = with_modules(PRESET, n).with_value("ground.friction", 256.5 * c).with_value("legs.half_width", 0.0728 * b)
    robot = robot.with_value("legs.forward_offset", x0).with_value("gait.module_phase", math.radians(phase))
    robot = robot.with_value("gait.side_phase", math.radians(side))
    check(lambda k: PlanarModel(robot.with_value("springs.stiffness[0]", k)), (3.0 * UNIT, 40.0 * UNIT))


def test_a_pair_that_meets_outside_the_circle_is_no_bifurcation():
    # Near k = 0.217 a complex pair of modulus 1.07 becomes two real multipliers; one of these crosses +1 soon after.
    robot = Robot(
        name="a pair meets",
        body={"modules": 4, "length": 1.4715177646857693, "mass": 4.0},
        springs={"stiffness": [1.0, 1.0, 1.0], "damping": 0.0},
        legs={"forward_offset": 0.0, "half_width": 0.0},
        gait={
            "stride": 0.36787944117144233,
            "stance": 0.25,
            "swing": 0.75,
            "module_phase": "120 deg",
            "side_phase": "180 deg",
        },
        ground={"friction": 20.085536923187668},
    )
    found = locate(lambda k: PlanarModel(robot.with_value("springs.stiffness", k)), (0.1, 1.0), normal_form=False)
    assert [point.kind for point in found] == [Kind.PITCHFORK] * 2
