"""Maps of a cycle of models in MuJoCo: what is refused, and in which words."""

import mujoco
import numpy as np
import pytest

from chilopod.analysis import cycle_multipliers
from chilopod.analysis.cycle_multipliers import finite_modes
from chilopod.errors import AnalysisError, ParameterError
from chilopod.twin import CycleMap

SPRING = """<mujoco><option timestep="0.002"/><worldbody><body>
  <joint name="a" type="slide" axis="1 0 0" stiffness="3" damping="0.5"/>
  <geom size="0.1" mass="1" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""


@pytest.fixture
def cycle():
    return CycleMap(mujoco.MjModel.from_xml_string(SPRING), np.zeros((250, 0)))


@pytest.mark.parametrize("count", [1, 4, 5, 8])
def test_bars_that_repeat_within_a_metre_are_no_flat_floor(count):
    bars = "".join(f'<geom type="capsule" fromto="{i / count} -1 0 {i / count} 1 0" size="0.06"/>' for i in range(12))
    text = f"""<mujoco><option cone="elliptic"/><worldbody>{bars}<body pos="0 0 0.1795">
      <joint name="x" type="slide" axis="1 0 0" damping="1"/><joint name="z" type="slide" axis="0 0 1" damping="1"/>
      <geom size="0.12" mass="1" friction="0 0 0"/></body></worldbody></mujoco>"""
    # The ball stands on a bar, from which it slides to either side.
    cycle = CycleMap(mujoco.MjModel.from_xml_string(text), np.zeros((50, 0)), travel=("x",))
    assert cycle.depends_on_place(np.zeros(3)) == "x"
    with pytest.raises(AnalysisError, match="must not depend on x, which is divided out"):
        cycle_multipliers("ball", cycle, np.zeros(3), ["z"])


BODY = '<body pos="1 0 0">{}<geom size="0.1"/></body>'
HINGE = BODY.format('<joint name="p"/>')
MOTOR = '<actuator><motor name="m" joint="p" {}/></actuator>'


@pytest.mark.parametrize(
    ("bodies", "others", "complaint"),
    [
        ('<geom size="1"/>', "", "model: must have a joint"),
        (BODY.format('<joint type="ball" name="b"/>'), "", "model joint b: must be a hinge or a slide, not a ball"),
        (BODY.format("<freejoint/>") * 2, "", "model joint 1: must not be free: only the first joint may"),
        (HINGE, MOTOR.replace("motor", "muscle").format('lengthrange="0 1"'), "model actuator m: must have no state"),
        (HINGE, MOTOR.format('delay="0.3" nsample="200"'), "model actuator m: must have no delay"),
        (HINGE, '<sensor><jointpos joint="p" delay=".1" nsample="9"/></sensor>', "model sensor 0: must have no delay"),
        (
            BODY.format('<joint name="p" stiffness="5" springyield="1"/>'),
            "",
            "joint p: must have a spring that does not",
        ),
        (HINGE, '<option gravity="1 0 -9"/>', r"model.opt.gravity = \[1.0, 0.0, -9.0\]: must be vertical"),
        (HINGE, '<option><flag sleep="enable"/></option>', "model.opt.enableflags: must not let bodies sleep"),
    ],
)
def test_what_hides_a_part_of_the_state_is_named(bodies, others, complaint):
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody>{others}</mujoco>")
    with pytest.raises(ParameterError, match=complaint):
        CycleMap(model, np.zeros((5, model.nu)))


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("opt.timestep", 0.0, "opt.timestep = 0.0: must be a time step in s; allowed: above 0"),
        ("opt.timestep", -0.001, "opt.timestep = -0.001: must be a time step"),
        ("opt.timestep", np.nan, "opt.timestep = nan: must be a time step"),
        ("opt.viscosity", np.inf, "opt.viscosity = inf: must be finite"),
        ("body_mass", [0.0, np.nan], r"body_mass\[1\] = nan: must be finite"),
        ("jnt_range", [[-np.inf, np.nan]], r"jnt_range\[0, 1\] = nan: must be finite"),
    ],
)
def test_numbers_of_a_model_are_finite_and_time_goes_on(name, value, complaint):
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{HINGE}</worldbody></mujoco>")
    if isinstance(value, list):
        getattr(model, name)[:] = value
    else:
        setattr(model.opt, name.removeprefix("opt."), value)
    with pytest.raises(ParameterError, match=f"model.{complaint}"):
        CycleMap(model, np.zeros((5, 0)))
    model.opt.timestep, model.opt.viscosity, model.body_mass[1], model.jnt_range[0, 1] = 0.01, 0.0, 1.0, np.inf
    assert CycleMap(model, np.zeros((5, 0))).period == 0.05


def test_controls_must_be_finite():
    with pytest.raises(ParameterError, match="control = nan: must be finite"):
        CycleMap(
            mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{HINGE}</worldbody>{MOTOR}</mujoco>".replace("{}", "")),
            [[np.nan]],
        )


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        (lambda cycle: CycleMap("x", cycle.control), "model = 'str': must be a mujoco.MjModel"),
        (lambda cycle: CycleMap(cycle.model, cycle.control, None), "travel: must name joints"),
        (
            lambda cycle: cycle(np.zeros(3)),
            r"x = \(3,\): must be coordinates; allowed: \(runs, 2\)",
        ),
        (lambda cycle: cycle(np.zeros((0, 2))), r"x = \(0, 2\): must be coordinates"),
        (lambda cycle: cycle("x"), "x = 'x': must be an array of numbers"),
        (lambda cycle: cycle.path(np.zeros((2, 2))), r"x = \(2, 2\): must be the coordinates of a state"),
        (lambda cycle: cycle.depends_on_place(np.zeros((2, 2))), r"x = \(2, 2\): must be the coordinates of a state"),
        (lambda cycle: cycle.reduced([0.0], [0.0, 1.0]), r"positions, rates = .*must have the shapes of states"),
        (
            lambda cycle: cycle_multipliers("leg", cycle.model, [0.0, 0.0], ["a"]),
            "cycle = 'MjModel': must be a chilopod.twin.CycleMap",
        ),
    ],
)
def test_wrong_arguments_of_a_cycle_map_are_one_line(cycle, wrong, complaint):
    assert cycle([0.0, 0.0])[0].tolist() == [[0.0, 0.0]]
    with pytest.raises(ParameterError, match=complaint):
        wrong(cycle)


def test_lists_are_states_and_a_cycle_map_does_not_change(cycle):
    path = cycle.path([0.1, 0.0])
    np.testing.assert_array_equal(path[-1], cycle([0.1, 0.0])[0][0])
    assert cycle.reduced([1.0], [2.0]).tolist() == [1.0, 2.0]
    assert cycle.depends_on_place([0.1, 0.0]) == ""
    assert cycle.changing([0.1, 0.0]) == ()
    modes = [finite_modes(cycle, start, ["a"])[0][0].multiplier for start in ([0.1, 0.0], np.array([0.1, 0.0]))]
    assert modes[0] == modes[1]
    with pytest.raises(ValueError, match="read-only"):
        cycle.control[:] = 3.0
    with pytest.raises(AttributeError, match="period"):
        cycle.period = 9.0
