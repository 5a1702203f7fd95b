"""Balances, symmetries and limits that hold whatever the robot."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from chilopod import Robot, load_robot
from chilopod.planar import PlanarModel, energy, powers
from chilopod.planar.energy import module_motion
from chilopod.planar.linear import mass_matrix
from chilopod.stability import multipliers
from helpers.planar_strategies import energy_rate, mid_interval, robots, state_of

PRESET = load_robot("aoi2022-planar")
fractions = st.floats(0.0, 0.999)
insides = st.floats(0.1, 0.9)


@given(robots(), st.integers(0, 1000), fractions, insides)
def test_power_balances_and_friction_only_takes(robot, seed, fraction, inside):
    model = PlanarModel(robot)
    t, x = mid_interval(model, fraction, inside), state_of(model, seed, bend=1.5)
    power = powers(model, x, t)
    slope = model.rhs(t, x)
    rate = energy_rate(model, x, slope)
    # Accelerations carry the round-off of a nearly singular mass matrix; times the momenta it is this much.
    _, twist = module_motion(model, x)
    size = abs(power.legs) + abs(power.floor) + abs(power.dampers)
    size += robot.module_mass * np.abs(twist[:, :2]).sum() * np.abs(slope[:2]).max() * model.modules
    size += (model.stiffness * np.abs(x[3 : model.modules + 2] * slope[3 : model.modules + 2])).sum()
    assert abs(power.legs + power.floor + power.dampers - rate) <= 1e-11 * size
    assert power.floor <= 0.0
    assert power.dampers <= 0.0
    if any(robot.springs.damping):
        assert power.dampers < 0.0


def test_energy_is_that_of_moving_rods_and_bent_springs():
    model = PlanarModel(PRESET)
    x = state_of(model, 2)
    heading, twist = module_motion(model, x)
    np.testing.assert_allclose(heading, np.cumsum([0.0, *x[3:8]]), rtol=0, atol=1e-15)
    np.testing.assert_allclose(twist[:, 2], np.cumsum([x[2], *x[8:]]), rtol=0, atol=1e-15)
    elastic = 0.5 * (model.stiffness * x[3:8] ** 2).sum()
    # Kinetic energy is quadratic in the velocities, elastic energy in the angles.
    faster, wider = x.copy(), x.copy()
    faster[3:8], wider[:3], wider[8:] = 0.0, 0.0, 0.0
    straight = x - wider
    assert energy_rate(model, x, faster) == pytest.approx(2 * (energy(model, x) - elastic), rel=1e-12)
    assert energy(model, wider) == pytest.approx(elastic, rel=1e-13)
    assert energy(model, 2 * straight) == pytest.approx(4 * energy(model, straight), rel=1e-13)
    assert energy(model, model.orbit) == pytest.approx(0.5 * 8.5 * (0.03 / 0.31) ** 2, rel=1e-14)
    still = powers(model, model.orbit, 0.05)
    assert (still.legs, still.floor, still.dampers) == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)


@given(robots(), st.integers(0, 1000), fractions, insides)
def test_seen_in_a_mirror_left_and_right_change_places(robot, seed, fraction, inside):
    # In the mirror the right legs lead by minus the side phase, and the left ones are a side phase late.
    model = PlanarModel(robot)
    mirrored = PlanarModel(robot.with_value("gait.side_phase", -robot.gait.side_phase))
    late = robot.gait.side_phase / (2 * math.pi) * model.period
    t, x = mid_interval(model, fraction, inside), state_of(model, seed)
    mirror = model.reflection
    there, here = mirrored.rhs(t + late, mirror @ x), mirror @ model.rhs(t, x)
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-10 * np.abs(here).max())


@given(robots(side_phase=st.just(math.pi)), st.integers(0, 1000), fractions, insides)
def test_half_a_period_later_the_sides_have_changed_places(robot, seed, fraction, inside):
    model = PlanarModel(robot)
    t, x, mirror = mid_interval(model, fraction, inside), state_of(model, seed), model.symmetry
    assert mirror is not None
    here = mirror @ model.rhs(t, x)
    np.testing.assert_allclose(
        model.rhs(t + model.period / 2, mirror @ x), here, rtol=0, atol=1e-10 * np.abs(here).max()
    )
    half, whole = (model.flow(model.orbit, 0.0, part * model.period)[1] for part in (0.5, 1.0))
    np.testing.assert_allclose(
        mirror @ half @ mirror @ half, whole, rtol=0, atol=1e-10 * max(1, np.abs(half).max() ** 2)
    )


@given(robots(side_phase=st.just(0.0)), st.integers(0, 1000), fractions, insides)
def test_legs_that_move_together_make_every_motion_a_mirror_image_of_another(robot, seed, fraction, inside):
    model = PlanarModel(robot)
    t, x, mirror = mid_interval(model, fraction, inside), state_of(model, seed), model.spatial_symmetry
    assert mirror is not None
    assert model.symmetry is None
    here = mirror @ model.rhs(t, x)
    np.testing.assert_allclose(model.rhs(t, mirror @ x), here, rtol=0, atol=1e-12 * np.abs(here).max())


def test_other_side_phases_have_no_symmetry_to_offer():
    for degrees, half, spatial in [(180, True, False), (-180, True, False), (0, False, True), (360, False, True)]:
        model = PlanarModel(PRESET.with_value("gait.side_phase", math.radians(degrees)))
        assert (model.symmetry is not None, model.spatial_symmetry is not None) == (half, spatial)
    model = PlanarModel(PRESET.with_value("gait.side_phase", math.radians(179)))
    assert model.symmetry is None
    assert model.spatial_symmetry is None


@given(robots(st.integers(2, 6)), st.integers(-4, 4), st.integers(-4, 4), st.integers(-4, 4))
def test_other_units_of_length_mass_and_time_change_nothing_else(robot, a, b, c):
    length, mass, time = 2.0 ** (a / 2), 2.0 ** (b / 2), 2.0 ** (c / 2)
    torque = mass * length**2 / time**2
    body, gait = robot.body, robot.gait
    inertia = {} if body.yaw_inertia is None else {"yaw_inertia": body.yaw_inertia * mass * length**2}
    other = Robot(
        name="other units",
        body={"modules": body.modules, "length": body.length * length, "mass": body.mass * mass, **inertia},
        springs={
            "stiffness": [k * torque for k in robot.springs.stiffness],
            "damping": [d * torque * time for d in robot.springs.damping],
        },
        legs={"forward_offset": robot.legs.forward_offset * length, "half_width": robot.legs.half_width * length},
        gait={
            "stride": gait.stride * length,
            "stance": gait.stance * time,
            "swing": gait.swing * time,
            "module_phase": gait.module_phase,
            "side_phase": gait.side_phase,
        },
        ground={"friction": robot.ground.friction * mass / time},
    )
    first, second = PlanarModel(robot), PlanarModel(other)
    n = robot.body.modules
    speed, rate, angle = [length / time] * 2, [1 / time] * n, [1.0] * (n - 1)
    scale = np.array([*speed, rate[0], *angle, *rate[1:]])
    _, here, bound = first.flow_with_error(first.orbit, 0.0, first.period)
    _, there, other_bound = second.flow_with_error(second.orbit, 0.0, second.period)
    there = there / scale[:, None] * scale
    units = (scale / scale[:, None]).max()
    np.testing.assert_allclose(there, here, rtol=0, atol=bound + other_bound * units)
    x = state_of(first, 1)
    slope = first.rhs(mid_interval(first, 0.3), x)
    scaled = second.rhs(mid_interval(second, 0.3), x * scale) / scale * time
    for rows in (slice(0, 2), slice(2, 3), slice(3, n + 2), slice(n + 2, None)):
        np.testing.assert_allclose(scaled[rows], slope[rows], rtol=0, atol=1e-10 * np.abs(slope[rows]).max())


def test_slow_multipliers_depend_on_stiffness_over_friction_and_speed_alone():
    # Where feet damp at once, inertia does not matter: softer springs on more slippery ground are the same thing.
    def slow(mass, stiffness, friction):
        robot = PRESET.with_value("body.mass", mass).with_value("springs.stiffness", stiffness)
        return multipliers(PlanarModel(robot.with_value("ground.friction", friction))).values[:3]

    expected = slow(1e-2, 0.8, 256.5)
    np.testing.assert_allclose(slow(1e-3, 0.08, 25.65), expected, rtol=1e-9)
    np.testing.assert_allclose(slow(1e-3, 0.8, 256.5), expected, rtol=1e-2)
    assert np.abs(slow(1e-2, 0.08, 256.5) - expected).max() > 0.1


def rigid_flow(robot):
    """Velocity (vx, vy, w) of two modules welded together after a period, as a linear function of that at the start."""
    gait, length, mass = robot.gait, robot.module_length, robot.module_mass
    centres = np.array([0.0, -length])  # of the modules, ahead of module 1's
    centroid = -length / 2
    inertia = 2 * robot.module_yaw_inertia + 2 * mass * (length / 2) ** 2
    # Velocity of module 1's centre and yaw rate <-> momentum about the common centre.
    to_centre = np.array([[1, 0, 0], [0, 1, centroid], [0, 0, 1.0]])
    weight = np.diag([2 * mass, 2 * mass, inertia])
    phases = gait.leg_phases(2)

    def slope(t, flat, standing, middle):
        z = flat.reshape(3, 3)
        force = np.zeros((3, 3))
        for i, side in zip(*np.nonzero(standing), strict=True):
            since = (middle / gait.period + phases[i, side]) % 1.0 * gait.period + t - middle
            x = centres[i] + robot.legs.forward_offset + gait.stride / 2 - gait.speed * since
            y = (1 - 2 * side) * robot.legs.half_width
            slip = np.array([[1, 0, -y], [0, 1, x]]) @ z
            push = -robot.ground.friction * slip
            force += np.stack([push[0], push[1], (x - centroid) * push[1] - y * push[0]])
        acceleration = np.linalg.solve(to_centre, np.linalg.solve(weight, force))
        acceleration[1] -= gait.speed * z[2]  # the frame turns
        return acceleration.ravel()

    z = np.eye(3).ravel()
    times = gait.schedule(2).times
    for start, end in zip(times[:-1], times[1:], strict=True):
        middle = (start + end) / 2
        standing = (middle / gait.period + phases) % 1.0 < gait.duty
        z = solve_ivp(slope, (start, end), z, "DOP853", args=(standing, middle), rtol=1e-12, atol=1e-14).y[:, -1]
    return z.reshape(3, 3)


@pytest.mark.parametrize("side_phase", [180.0, 75.0])
def test_a_very_stiff_joint_makes_one_rigid_body_of_two_modules(side_phase):
    base = PRESET.with_value("body.modules", 2).with_value("body.length", 0.45).with_value("body.mass", 8.5 / 3)
    base = base.with_value("ground.friction", 20.0).with_value("gait.side_phase", math.radians(side_phase))
    mass, _ = mass_matrix(2, base.module_length, base.module_mass, base.module_yaw_inertia)
    torque = np.array([0.0, 0.0, -1.0, 1.0])
    compliance = torque @ np.linalg.solve(mass, torque)
    expected = rigid_flow(base)
    errors = []
    for stiffness in (1e4, 1e5, 1e6):
        # Damped critically, so that the joint does not ring on after a foot has touched down.
        robot = base.with_value("springs.damping", 2.0 * math.sqrt(stiffness / compliance))
        model = PlanarModel(robot.with_value("springs.stiffness", stiffness))
        _, matrix = model.flow(model.orbit, 0.0, model.period)
        errors.append(np.abs(matrix[:3, :3] - expected).max() / np.abs(expected).max())
    assert errors[0] < 1e-3
    assert errors[1] == pytest.approx(errors[0] / 10, rel=0.1)
    assert errors[2] == pytest.approx(errors[1] / 10, rel=0.1)
