"""Multipliers of walks in MuJoCo: against solutions by hand, walks that decay, and other paths to the same state."""

from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from chilopod import load_robot
from chilopod.analysis import cycle_multipliers, walk_multipliers
from chilopod.analysis.cycle_modes import CycleMode, CycleMultipliers
from chilopod.analysis.cycle_multipliers import AMPLITUDE, _closed, spectral_moves
from chilopod.analysis.parameters import K1
from chilopod.errors import AnalysisError, ParameterError
from chilopod.twin import CycleMap, start, walk_cycle
from helpers.command_line import printed, run

STIFF = load_robot("aoi2022").set_from_text(["springs.stiffness[0]=75 N*mm/deg"])
PERIOD = STIFF.gait.period
CART = """<mujoco><option timestep="0.01" gravity="0 0 0"/><worldbody>
  <body><joint name="x" type="slide" axis="1 0 0" damping="0.3"/>
  <geom size="0.1" mass="1" contype="0" conaffinity="0"/></body>
  <body><joint name="y" type="slide" axis="0 1 0" stiffness="2" damping="0.1"/>
  <geom size="0.1" mass="1" contype="0" conaffinity="0"/></body>
</worldbody><actuator><motor joint="x"/><motor joint="y"/></actuator></mujoco>"""


@pytest.fixture(scope="module")
def straight():
    return walk_multipliers(STIFF, cycles=12)


@pytest.mark.parametrize("amplitude", [AMPLITUDE, 1e-5])
def test_a_cart_and_a_spring_have_the_multipliers_of_their_steps(amplitude):
    steps = 100
    control = np.sin(2.0 * np.pi * np.arange(steps) / steps)[:, None] * [1.0, 0.5]
    cycle = CycleMap(mujoco.MjModel.from_xml_string(CART), control, travel=("x",))
    assert cycle.names == ("y", "rate of x", "rate of y")
    found = cycle_multipliers("cart", cycle, np.zeros(3), ["y"], amplitude)
    # Euler's step with the damper at its end: v' = (v - h k x / m) / (1 + h d / m), x' = x + h v'.
    step = np.array([[1.0 - 2e-4 / 1.001, 0.01 / 1.001], [-0.02 / 1.001, 1.0 / 1.001]])
    pair = np.linalg.eigvals(step)[0] ** steps
    expected = {"other": 1.003**-steps, "bend": complex(pair.real, abs(pair.imag))}
    for modes in (found.exact, found.finite):
        assert {mode.shape: mode.multiplier for mode in modes} == pytest.approx(expected, abs=1e-7)
    assert found.stable is True
    assert found.mismatch < 1e-11


@pytest.mark.parametrize(("damping", "begun"), [(20.0, 2.5), (500.0, 2.0)])
def test_the_motion_is_the_one_that_the_start_settles_into(damping, begun):
    """A pendulum in oil sinks from near the top and hangs; standing on its top it repeats too."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002"/><worldbody><body><joint name="q" axis="0 1 0" damping="{damping}"/>
        <geom size="0.05" pos="0 0 -0.5" mass="1"/></body></worldbody>
        <actuator><motor joint="q"/></actuator></mujoco>"""
    )
    cycle = CycleMap(model, 0.5 * np.sin(2.0 * np.pi * np.arange(100) / 100)[:, None])
    found = cycle_multipliers("pendulum", cycle, np.array([begun, 0.0]), ["q"])
    assert found.stable is True
    assert abs(found.state[0]) < 1e-2
    # Overdamped, c q' = -m g l q over the period.
    assert found.exact[0].multiplier.real == pytest.approx(np.exp(-9.81 * 0.5 * 0.2 / damping), abs=5e-4)


@pytest.mark.parametrize("cycles", [70, 100, 130])
def test_a_motion_that_stalls_and_then_settles_is_found(cycles):
    """A slide with dry friction is slowed down evenly and comes to rest after some cycles; a spring swings besides."""
    text = CART.replace('damping="0.3"', 'frictionloss="0.01"')
    cycle = CycleMap(mujoco.MjModel.from_xml_string(text), np.zeros((100, 2)), travel=("x",))
    found = cycle_multipliers("cart", cycle, np.array([0.1, 0.01 * cycles, 0.0]), ["y"])
    step = np.array([[1.0 - 2e-4 / 1.001, 0.01 / 1.001], [-0.02 / 1.001, 1.0 / 1.001]])
    pair = np.linalg.eigvals(step)[0] ** 100
    assert found.stable is True
    assert found.exact[0].multiplier == pytest.approx(complex(pair.real, abs(pair.imag)), abs=1e-7)


def test_the_fixed_point_is_found_beside_many_slow_modes():
    """The image of a state, x - A x - x^3 with eigenvalues of A from 0.001 to 1, is the state at 0 alone."""
    rates = np.geomspace(1e-3, 1.0, 40)

    def cycle(states):
        return states - rates * (states + 3.0 * states**3), None

    found, closes = _closed(cycle, np.full(40, 0.3))
    assert closes
    assert np.abs(found).max() < 1e-8


def test_a_mode_that_dies_out_at_once_does_not_hide_the_others():
    """A pendulum on a stiff lift, from two starts: the second derivative has a block that is nearly zero, and whose
    left and right vectors are orthogonal."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.002"/><worldbody><body><joint name="lift" type="slide" axis="0 0 1"/>
        <geom size=".05" mass="5" contype="0" conaffinity="0"/><body><joint name="q" axis="0 1 0" damping="0.02"/>
        <geom size="0.05" pos="0 0 -0.5" mass="1" contype="0" conaffinity="0"/></body></body></worldbody>
        <actuator><position joint="lift" kp="200000" kv="2000"/></actuator></mujoco>"""
    )
    cycle = CycleMap(model, 0.02 * np.sin(2.0 * np.pi * np.arange(353) / 353)[:, None])
    for begun in (0.0, 0.5):
        found = cycle_multipliers("swing", cycle, np.array([0.0, begun, 0.0, 0.0]), ["q"])
        assert found.stable is False
        # Liouville: the product is exp of the mean divergence, -d / (m l^2 + I) over the period, to the step's order.
        inertia = 0.25 + 0.4 * 0.05**2
        first, second = (mode.multiplier.real for mode in found.exact[:2])
        assert first * second == pytest.approx(np.exp(-0.02 / inertia * 0.706), rel=1e-4)
        assert max(mode.error for mode in found.exact) < 1e-7
        assert [round(mode.multiplier.real, 2) for mode in found.finite[:2]] == [-1.1, -0.86]


def test_coordinates_lead_to_the_state_and_back_wherever_it_stands():
    cycle, standing = walk_cycle(STIFF)
    x = standing + np.random.default_rng(0).uniform(-0.02, 0.02, (3, 71))
    positions, rates = cycle.full(x)
    np.testing.assert_allclose(cycle.reduced(positions, rates), x, rtol=0, atol=1e-12)
    cos, sin = np.cos(0.7), np.sin(0.7)
    turned = np.array([[cos, -sin], [sin, cos]])
    moved, rotated = positions.copy(), rates.copy()
    moved[:, :2] = [3.0, -2.0]
    half = np.array([np.cos(0.35), 0.0, 0.0, np.sin(0.35)])
    for row in moved:
        mujoco.mju_mulQuat(row[3:7], half, row[3:7].copy())
    rotated[:, :2] = rates[:, :2] @ turned.T
    np.testing.assert_allclose(cycle.reduced(moved, rotated), x, rtol=0, atol=1e-12)
    walk = start([STIFF] * 3, initial=np.hstack([moved, rotated]), record=None, tolerance=1e-15)
    walk.advance(PERIOD)
    states = walk.states()
    reached = cycle.reduced(*np.split(states, [cycle.model.nq], axis=1))
    np.testing.assert_allclose(cycle(x)[0], reached, rtol=0, atol=1e-9)
    cycle.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_WARMSTART)
    np.testing.assert_allclose(cycle(x)[0], reached, rtol=0, atol=1e-6)


def test_small_bends_of_independent_walks_decay_by_the_multipliers(straight):
    assert straight.stable
    assert straight.mismatch < 1e-9
    assert max(mode.error for mode in straight.exact) < 1e-4
    cycle, _ = walk_cycle(STIFF)
    bent = np.array([cycle.names.index(f"yaw{i}") for i in range(1, 6)])
    states = np.tile(straight.state, (2, 1))
    states[:, bent] += 1e-6 * np.array([[1.0], [-1.0]]) * [0.3, 0.5, 0.2, 1.0, 0.6]
    walk = start([STIFF] * 2, initial=np.hstack(cycle.full(states)), record=None, tolerance=1e-15)
    angles = []
    for i in range(1, 31):
        walk.advance(i * PERIOD)
        angles.append(walk.observe().joint_angles)
    bends = np.array([0.5 * (each[0] - each[1]) for each in angles])[4:]
    # The angles of every joint obey one linear recurrence, whose roots are the multipliers.
    order = 4
    rows = np.concatenate([[bends[i : i + order, j] for i in range(len(bends) - order)] for j in range(5)])
    ahead = np.concatenate([bends[order:, j] for j in range(5)])
    roots = np.roots([1.0, *-np.linalg.lstsq(rows, ahead, rcond=None)[0][::-1]])
    for mode in straight.exact:
        assert np.abs(roots - mode.multiplier).min() < 1e-3


def test_modes_and_the_grazing_foot_have_names(straight):
    assert [mode.shape for mode in straight.exact] == ["undulation", "bend"]
    assert 1e-6 < straight.reach < 1e-3
    assert any(words.startswith("leg6_left_foot at 0.004") for words in straight.contacts)
    printed = straight.as_json()
    assert printed["closes"] is True
    assert printed["multipliers"][0]["frequency_rad_s"] * PERIOD == pytest.approx(2.0 * np.pi / 36.0, rel=0.05)
    assert len(printed["multipliers"][0]["joint_components"]) == 5
    assert "changes a contact; larger ones do: leg" in "\n".join(straight.lines())


def test_bends_set_in_where_their_multiplier_passes_1(monkeypatch):
    per_unit = STIFF.get(K1) / 75.0

    def measured(robot, **given):
        spring = robot.get(K1) / per_unit
        bent = ("yaw1", 0.3) if spring < 25.0 else None
        return SimpleNamespace(
            finite=(CycleMode(complex(np.exp(0.01 * (30.0 - spring))), 0.001, np.ones(5)),), given_way=bent
        )

    monkeypatch.setattr("chilopod.analysis.walk_multipliers", measured)
    arguments = ["stability", "aoi2022", "--engine", "twin", "--json", "--onset", K1]
    for low in ("26 N*mm/deg", "5 N*mm/deg"):
        found = printed(*arguments, low, "50 N*mm/deg")
        # Its error over the slope.
        np.testing.assert_allclose(
            np.array([found["onset_si"], *found["interval_si"]]) / per_unit, [30.0, 29.9, 30.1], atol=0.03
        )
    assert "must hold an onset" in run(*arguments, "40 N*mm/deg", "50 N*mm/deg")[2]
    assert run(*arguments, "0.2", "50 N*mm/deg")[2].startswith("note: a number without a unit is SI: --onset is 0.2")
    said = run(*arguments, "10 N*mm/deg", "27 N*mm/deg")[2]
    assert "must hold an onset; its ends have a walk that has given way and the multiplier 1.0305" in said


def test_the_command_line_prints_them(straight, monkeypatch):
    asked = []
    monkeypatch.setattr("chilopod.analysis.walk_multipliers", lambda robot, **given: asked.append(given) or straight)
    arguments = ["stability", "aoi2022", "--engine", "twin", "--amplitude", "2 deg"]
    assert printed(*arguments, "--json") == straight.as_json()
    assert run(*arguments)[1].splitlines() == straight.lines()
    assert run(*arguments[:-2], "--json")[0] == 0
    assert [each["amplitude"] for each in asked] == pytest.approx(np.radians([2.0, 2.0, 1.0]))


@pytest.mark.parametrize(
    ("overrides", "complaint"),
    [
        (["gait.swing=0.2913 s"], "twin.control_interval = '0.002 s': must repeat with the gait"),
        (["twin.joint_inertia=0.0001 kg*m^2"], "twin.timestep = '2 ms': must be shorter for the damping of the servos"),
    ],
)
def test_what_has_no_cycle_map_is_refused(overrides, complaint):
    with pytest.raises(ParameterError, match=complaint):
        walk_multipliers(STIFF.set_from_text(overrides))


FALL = """<mujoco><option timestep="0.01"/><worldbody>
  <body><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
  <geom size="0.1" mass="1"/></body></worldbody><actuator><motor joint="x"/></actuator></mujoco>"""


@pytest.mark.parametrize(
    ("push", "travel", "complaint"),
    [
        (0.0, (), "motion: must repeat: z changes by -[0-9.]+ m in each cycle"),
        (1.0, ("z",), "motion: must repeat: x changes by [0-9.]+ m in each cycle"),
        (1.0, ("x", "z"), "motion: must repeat: rate of x changes by 0.5 m/s in each cycle"),
    ],
)
def test_a_motion_that_moves_on_is_refused(push, travel, complaint):
    cycle = CycleMap(mujoco.MjModel.from_xml_string(FALL), np.full((50, 1), push), travel)
    with pytest.raises(AnalysisError, match=complaint):
        cycle_multipliers("fall", cycle, np.zeros(len(cycle.names)), ["rate of x"])


JOINT = """<mujoco><option timestep="0.002" gravity="0 0 0"/><worldbody><body>
  <joint name="yaw1" axis="0 0 1" stiffness="{}" damping="0.05"/>
  <geom size="0.1" pos="0.5 0 0" mass="1" contype="0" conaffinity="0"/></body></worldbody>
  <actuator><motor joint="yaw1"/></actuator></mujoco>"""


# The joint without a spring turns at 0.4 rad/s for 30.9 s, less 5.08 s in which it begins, and 0.19 rad by its swing.
@pytest.mark.parametrize(
    ("stiffness", "push", "mean"),
    [(2.0, 0.0, None), (2.0, 0.2, 0.1), (2.0, -0.2, -0.1), (2.0, 0.02, None), (0.0, 0.02, 0.4 * 25.82 + 0.19)],
)
def test_a_walk_that_bends_by_more_than_it_swings_has_given_way(stiffness, push, mean):
    control = push + 0.1 * np.sin(2.0 * np.pi * np.arange(300) / 300)[:, None]
    cycle = CycleMap(mujoco.MjModel.from_xml_string(JOINT.format(stiffness)), control)
    walker = SimpleNamespace(walk_cycle=lambda robot: (cycle, np.zeros(2)))
    found = walk_multipliers(SimpleNamespace(name="one", body=SimpleNamespace(modules=2)), walker)
    if mean is None:
        assert found.given_way is None
        assert found.stable is True
        return
    assert found.given_way == ("yaw1", pytest.approx(mean, rel=0.03))
    assert found.stable is False
    assert found.as_json()["given_way"]["mean_rad"] == found.given_way[1]
    assert found.title.startswith("one: the straight walk has given way: it bends (yaw1 = ")
    assert "The multipliers are those of the bent walk." in found.lines()[-1]


@pytest.mark.parametrize(
    ("start", "bends", "complaint"),
    [
        (np.zeros(4), ["y"], r"start = \[0.0, 0.0, 0.0, 0.0\]: must be the coordinates of a state; allowed: 3 finite"),
        ([0.0, np.nan, 0.0], ["y"], "start = .*must be the coordinates of a state"),
        (np.zeros(3), ["rate of X"], "bends = 'rate of X': must be a coordinate; did you mean 'rate of x'"),
        (np.zeros(3), "y", "bends = 'y': must be a list of names; allowed: y, rate of x, rate of y"),
        (np.zeros(3), [], "bends = .*must be a list of names"),
    ],
)
def test_a_start_and_bends_that_are_none_are_refused(start, bends, complaint):
    cycle = CycleMap(mujoco.MjModel.from_xml_string(CART), np.zeros((5, 2)), travel=("x",))
    with pytest.raises(ParameterError, match=complaint):
        cycle_multipliers("cart", cycle, start, bends)


@pytest.mark.parametrize(("cycles", "said"), [(5, "must be more"), (20.5, "must be a whole number"), (10**5, "is too")])
def test_cycles_must_be_enough(cycles, said):
    cycle = CycleMap(mujoco.MjModel.from_xml_string(CART), np.zeros((5, 2)), travel=("x",))
    with pytest.raises(ParameterError, match=rf"cycles = {cycles}: {said}.*; allowed: 12 to 10000"):
        cycle_multipliers("cart", cycle, np.zeros(3), ["y"], cycles=cycles)


def test_coordinates_have_units():
    cycle = CycleMap(mujoco.MjModel.from_xml_string(CART), np.zeros((100, 2)), travel=("x",))
    assert dict(zip(cycle.names, cycle.units, strict=True)) == {"y": "m", "rate of x": "m/s", "rate of y": "m/s"}
    walk = walk_cycle(STIFF)[0]
    units = dict(zip(walk.names, walk.units, strict=True))
    assert (units["height"], units["roll"], units["yaw1"], units["rate of up"]) == ("m", "rad", "rad", "m/s")
    assert (units["rate of roll"], units["rate of yaw1"]) == ("rad/s", "rad/s")


@pytest.mark.parametrize(
    ("bends", "size"),
    [(["y"], "0.0175 m"), (["rate of x", "rate of y"], "0.0175 m/s"), (["y", "rate of y"], "0.0175")],
)
def test_bends_are_shown_in_their_unit(bends, size):
    cycle = CycleMap(mujoco.MjModel.from_xml_string(CART), np.zeros((100, 2)), travel=("x",))
    rows = cycle_multipliers("cart", cycle, np.zeros(3), bends).lines()
    assert any(f"  {size}  " in f"  {row}  " for row in rows)
    assert not any("°" in row for row in rows)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_lengths_in_other_units_do_not_change_multipliers(scale):
    spec, steps, h = mujoco.MjSpec.from_string(STOP.replace("0.002", "0.01").format("", "")), 628, 0.01
    joint = spec.joint("a")
    joint.stiffness, joint.damping = [1.0, 0.0, scale**-2], [0.2, 0.0, 0.0]
    spec.add_actuator(name="m", target="a", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    push = 1.9 * np.cos(2.0 * np.pi * np.arange(steps) / steps)
    cycle = CycleMap(spec.compile(), scale * push[:, None])
    mode = cycle_multipliers("duffing", cycle, scale * np.array([1.41, 0.33]), ["a"]).exact[0]
    # Euler's step with the damper at its end, as for the cart, and its derivative.
    x, v = 1.41, 0.33
    for _ in range(20):
        whole = np.eye(2)
        for force in push:
            slope = h * (1.0 + 3.0 * x * x)
            whole = np.array([[1.0 - h * slope / 1.002, h / 1.002], [-slope / 1.002, 1.0 / 1.002]]) @ whole
            v = (v + h * (force - x - x**3)) / 1.002
            x += h * v
    value = np.linalg.eigvals(whole)[0]
    assert abs(mode.multiplier - complex(value.real, abs(value.imag))) < mode.error < 2e-4


def test_a_walk_that_falls_is_refused():
    cycle, lying = walk_cycle(STIFF)
    lying[1] = 1.5
    with pytest.raises(AnalysisError, match="the walk falls"):
        cycle(lying[None])


LIMITED = """<mujoco><option timestep="0.002" integrator="RK4"/><worldbody>
  <body><joint name="h" axis="0 1 0" damping="0.05" limited="true" range="-10 60"/>
  <geom size=".05" pos="0 0 -.5" mass="1" contype="0" conaffinity="0"/></body>
</worldbody><actuator><motor joint="h"/></actuator></mujoco>"""


def test_bends_that_decay_are_no_stable_motion():
    # Differences of mj_step round the periodic motion give a multiplier of 1.67; the motion beside it never repeats.
    push = 2.5 * np.sin(2.0 * np.pi * np.arange(500) / 500)[:, None]
    found = cycle_multipliers("lim", CycleMap(mujoco.MjModel.from_xml_string(LIMITED), push), np.zeros(2), ["h"])
    assert not found.exact
    assert found.stable is None
    assert found.title == "lim: bends of 1° decay; no periodic motion was found from this start"
    assert any(words.startswith("limit of h at 0.9") for words in found.contacts)
    assert "no derivative" not in "\n".join(found.lines())  # which nobody has seen


SPRING = """<body pos="0 {0} 0"><joint name="p{0}" type="slide" axis="0 0 1" stiffness="4" damping=".3"/>
  <geom type="sphere" size=".1" mass="1" contype="0" conaffinity="0"/></body>"""


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6])
def test_equal_springs_have_the_multipliers_of_one(count):
    bodies = "".join(SPRING.format(i) for i in range(count))
    text = f'<mujoco><option gravity="0 0 0"/><worldbody>{bodies}</worldbody></mujoco>'
    cycle = CycleMap(mujoco.MjModel.from_xml_string(text), np.zeros((500, 0)))
    found = cycle_multipliers("springs", cycle, np.zeros(2 * count), [f"p{i}" for i in range(count)])
    step = np.array([[1.0 - 1.6e-5 / 1.0006, 0.002 / 1.0006], [-0.008 / 1.0006, 1.0 / 1.0006]])
    pair = np.linalg.eigvals(step)[0] ** 500
    assert found.stable is True
    for mode in found.exact:
        assert abs(mode.multiplier - complex(pair.real, abs(pair.imag))) < 1e-12
        assert 0.0 < mode.error < 1e-12  # rounding


SLIDE = """<mujoco><worldbody><body><joint name="x" type="slide" axis="1 0 0" damping="2" stiffness="{}"/>
  <geom size=".1" mass="1" contype="0" conaffinity="0"/></body>
  <body><joint name="p" axis="0 1 0" stiffness="5" damping=".3"/>
  <geom size=".1" mass="1" pos="0 0 -.3" contype="0" conaffinity="0"/></body></worldbody>
  <actuator><motor joint="p"/></actuator></mujoco>"""
BOX = """<mujoco><worldbody><geom type="plane" size="5 5 .1"/><site name="w"/><body pos="0 0 .1"><freejoint/>
  <geom type="box" size=".1 .1 .1" mass="1"/><site name="s"/><body pos="0 0 .1">
  <joint name="p" axis="0 1 0" stiffness="5" damping=".05"/>
  <geom type="box" size=".05 .05 .05" pos="0 0 .05" mass=".5" contype="0" conaffinity="0"/></body></body></worldbody>
  {}<actuator><motor joint="p"/></actuator></mujoco>"""
TETHER = """<tendon><spatial stiffness="5" springlength="0"><site site="w"/><site site="s"/></spatial></tendon>"""
PUSH = 0.05 * np.sin(2.0 * np.pi * np.arange(500) / 500)[:, None]


@pytest.mark.parametrize("stiffness", [-0.5, 2.0])
def test_a_place_that_matters_is_not_divided_out(stiffness):
    cycle = CycleMap(mujoco.MjModel.from_xml_string(SLIDE.format(stiffness)), PUSH, travel=("x",))
    with pytest.raises(AnalysisError, match="must not depend on x, which is divided out"):
        cycle_multipliers("slide", cycle, np.zeros(3), ["p"])


def test_a_joint_without_a_name_is_not_divided_out_either():
    model = mujoco.MjModel.from_xml_string(SLIDE.format(2).replace('name="x"', ""))
    cycle = CycleMap(model, PUSH, travel=("joint 0",))
    with pytest.raises(AnalysisError, match="must not depend on joint 0"):
        cycle_multipliers("slide", cycle, np.zeros(3), ["p"])


def test_a_free_body_on_a_tether_is_refused_and_bends_that_fall_leave_the_smallest():
    tied, free = (CycleMap(mujoco.MjModel.from_xml_string(BOX.format(each)), PUSH) for each in (TETHER, ""))
    start = np.zeros(len(free.names))
    start[0] = 0.1
    with pytest.raises(AnalysisError, match="must not depend on x"):
        cycle_multipliers("tied", tied, start, ["p"])
    found = cycle_multipliers("box", free, start, ["p"])
    assert found.exact
    assert not found.finite
    assert "only smallest ones are shown" in "\n".join(found.lines())


RESTING = """<mujoco><option cone="elliptic"/><worldbody><geom type="plane" size="5 5 .1"/>
  <body pos="0 0 .05" euler="0 {0} 0"><freejoint/><geom type="box" size=".2 .1 .05" mass="1" euler="0 -{0} 0"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("pitch", [0, 2, 57])
def test_a_box_at_rest_is_stable_whatever_the_frame_of_its_body(pitch):
    cycle = CycleMap(mujoco.MjModel.from_xml_string(RESTING.format(pitch)), np.zeros((50, 0)))
    start = np.zeros(9)
    start[[0, 2]] = 0.05, np.radians(pitch)
    found = cycle_multipliers("box", cycle, start, ["pitch"])
    assert found.title == "box: the periodic motion is stable"
    assert [abs(mode.multiplier) for mode in found.exact] == pytest.approx([0.030864, 0.030326, 0.029414], abs=2e-6)
    assert [mode.shape for mode in found.exact].count("bend") == 1


STOP = """<mujoco><option timestep="0.002"/><worldbody><body>
  <joint name="a" type="slide" axis="1 0 0" stiffness="3" damping="0.5" {}/>
  <geom size="0.1" mass="1" contype="0" conaffinity="0"/></body></worldbody>{}</mujoco>"""
SLACK = '<tendon><fixed stiffness="20" springlength="0 0.1"><joint joint="a" coef="1"/></fixed></tendon>'


def free_map(text):
    """Map of 250 steps of a model without controls."""
    return CycleMap(mujoco.MjModel.from_xml_string(text), np.zeros((250, 0)))


@pytest.mark.parametrize(
    ("parts", "switching"), [(('limited="true" range="0 1"', ""), "limit of a at 0.000"), (("", SLACK), "none found")]
)
def test_a_motion_on_a_switch_has_no_derivative(parts, switching):
    cycle, x = free_map(STOP.format(*parts)), np.array([0.01, 0.0])
    for _ in range(50):
        x = cycle(x)[0][0]
    assert np.abs(x).max() < 1e-4  # it decays
    found = cycle_multipliers("stop", cycle, np.zeros(2), ["a"])
    assert not found.exact
    assert found.stable is None
    assert found.as_json()["closes"] is True
    assert found.title.endswith("; the periodic motion has no derivative")
    said = " ".join("\n".join(found.lines()).split())
    assert f"lies on a switch, where there is no derivative. Contacts and limits that switch: {switching}" in said


def test_a_weak_slack_spring_is_part_of_the_error():
    found = cycle_multipliers("weak", free_map(STOP.format("", SLACK.replace("20", "0.001"))), np.zeros(2), ["a"])
    for stiffness in (3.0, 3.001):  # to either side
        step = np.array([[1.0 - 4e-6 * stiffness / 1.001, 0.002 / 1.001], [-0.002 * stiffness / 1.001, 1.0 / 1.001]])
        pair = np.linalg.eigvals(step)[0] ** 250
        assert abs(found.exact[0].multiplier - complex(pair.real, abs(pair.imag))) < found.exact[0].error < 2e-4


HOPPER = """<mujoco><option timestep="0.001" cone="elliptic"/><worldbody>
  <geom type="plane" size="1 1 1" solref="0.03 0.8"/><body pos="0 0 0.5"><joint name="z" type="slide" axis="0 0 1"/>
  <geom type="sphere" size="0.1" mass="1" contype="0" conaffinity="0"/><body pos="0 0 -0.4">
  <joint name="l" type="slide" axis="0 0 1" damping="2" stiffness="300"/>
  <geom type="sphere" size="0.05" mass="0.1"/></body></body></worldbody>
  <actuator><position joint="l" kp="100" kv="1"/></actuator></mujoco>"""


WHEEL = """<mujoco><option timestep="0.001" cone="elliptic"/><worldbody><geom type="plane" size="9 9 1"/>
  <body pos="0 0 0.2"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
  <joint name="spin" axis="0 1 0" damping="0.02"/><geom size="0.2" mass="1" friction="0.8 0 0"/></body>
</worldbody></mujoco>"""


def test_no_more_is_said_of_contacts_than_the_modes_reach():
    cycle = CycleMap(mujoco.MjModel.from_xml_string(WHEEL), np.zeros((100, 0)))
    found = cycle_multipliers("wheel", cycle, np.zeros(6), ["z"], cycles=12)
    raised = found.state + np.array([0.0, found.reach, 0.0, 0.0, 0.0, 0.0])
    assert (cycle(raised)[1] != cycle(found.state)[1]).any()  # the wheel leaves the floor, unlike along the modes
    assert not any(mode.angles.any() for mode in found.exact)
    said = "No move along these modes, up to about 0.005, changes a contact."
    assert said in "\n".join(found.lines())
    bends = replace(found, exact=(CycleMode(1.0 + 0.0j, 0.0, np.ones(1, complex)),))
    assert said.replace("move", "bend").replace("0.005", "0.005 m") in "\n".join(bends.lines())


def test_errors_contain_what_rounding_does_to_two_multipliers_near_zero():
    push = 0.03 * np.sin(2.0 * np.pi * np.arange(400) / 400)[:, None]
    cycle = CycleMap(mujoco.MjModel.from_xml_string(HOPPER), push)
    hop, small = cycle_multipliers("hopper", cycle, np.zeros(4), ["z", "l"]).exact
    assert abs(hop.multiplier - (-0.01698459 + 0.53109875j)) < hop.error < 1e-6
    # By the Jacobians of all 400 steps, multiplied in 40 digits.
    assert abs(small.multiplier - (3.90e-8 + 1.65e-8j)) < small.error < 1e-5


@pytest.mark.parametrize(
    ("matrix", "moved"),
    [
        (np.eye(3), 1e-9),
        (np.diag([0.5, 0.2, -0.1]), 1e-9),
        (np.diag([1.0, 0.0], 1), 1e-9**0.5),  # d^2 = error
        (np.diag([1.0, 1.0], 1) + np.diag([0.0, 1e-8, -1e-8]), 1e-9 ** (1 / 3)),
    ],
)
def test_an_error_of_a_matrix_moves_single_and_defective_eigenvalues(matrix, moved):
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    found = spectral_moves(turn @ matrix @ turn.T, np.linalg.eigvals(matrix).tolist(), 1e-9)
    assert moved <= max(found) < 4.0 * moved


def grown(cycle, bend, cycles):
    """Mean factor by which a bend grows, brought back to its size after every cycle."""
    size, growths = np.abs(bend[0]), []
    for _ in range(cycles):
        after = cycle(bend)[0][0]
        growths.append(np.abs(after[0]) / size)
        bend = after * size / np.abs(after[0])
    return np.exp(np.log(growths[cycles // 2 :]).mean())


def test_errors_of_bends_contain_the_growth_of_one_bend_to_one_side():
    text = STOP.replace('type="slide" axis="1 0 0" stiffness="3"', 'axis="0 1 0" pos="0 0 -1" stiffness="9"')
    cycle = free_map(text.format("", ""))
    mode = cycle_multipliers("pendulum", cycle, np.zeros(2), ["a"]).finite[0]
    assert 1e-9 < abs(mode.multiplier - grown(cycle, np.radians([1.0, 0.0]), 60)) < mode.error < 1e-7


def test_bends_that_meet_a_stop_to_one_side_do_not_grow():
    cycle = free_map(STOP.format('limited="true" range="-0.001 1" solreflimit="-1000 -10"', ""))
    found = cycle_multipliers("stop", cycle, np.zeros(2), ["a"])
    assert found.stable is True
    assert max(grown(cycle, np.array([side * found.amplitude, 0.0]), 100) for side in (1.0, -1.0)) < 0.9
    assert not any(abs(mode.multiplier) - mode.error > 1.0 for mode in found.finite)
    assert "grow" not in "\n".join(found.lines())


def test_modes_decay_each_within_its_own_error():
    modes = tuple(CycleMode(complex(value), error, np.ones(2)) for value, error in ((0.986, 2e-4), (0.258, 0.064)))
    found = CycleMultipliers("three", 0.6, np.zeros(2), 1e-3, (), None, 0.02, modes, np.zeros(2), ())
    assert found.title == "three: bends of 1.15° decay; no periodic motion was found from this start"


@pytest.mark.parametrize(
    ("multiplier", "error", "shown", "shape", "turns"),
    [
        (0.17 + 2e-12j, 5e-10, "0.17 twice", "undulation", 0.0),
        (-0.17 + 2e-12j, 5e-10, "-0.17 twice", "undulation of 2 cycles", 0.5),
        (-0.17 + 0.2j, 1.0, "-0.17 twice", "undulation", 0.0),
        (-2e-10 + 0.0j, 5e-10, "-2e-10", "undulation", 0.0),
        (0.2j, 5e-10, "0 ± 0.2j", "undulation of 4 cycles", 0.25),
    ],
)
def test_a_pair_turns_only_beyond_its_error(multiplier, error, shown, shape, turns):
    mode = CycleMode(multiplier, error, np.array([-0.2 + 0.8j, 1.0, 0.2 - 0.8j, -1.0]))
    _, value, _, modulus, *said = mode.cells("smallest")
    assert [value, said[0]] == [shown, shape]
    assert said[1] == ("-0.2+0.8j  1  0.2-0.8j  -1" if turns == 0.25 else "-0.2  1  0.2  -1")
    assert mode.as_json(2.0)["frequency_rad_s"] == pytest.approx(turns * np.pi)
    assert float(modulus) == pytest.approx(abs(complex(shown.split()[0]) if turns != 0.25 else multiplier), abs=1e-6)
