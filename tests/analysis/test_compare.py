"""Two robots, number by number."""

import importlib
import itertools
import re

import numpy as np
import pytest

from chilopod.analysis import Onset, bifurcations, compare
from chilopod.analysis.parameters import K1, stiffness
from chilopod.analysis.quantities import Measured, leading_mode
from chilopod.errors import ParameterError
from chilopod.robot import load_robot

ROBOT = load_robot("aoi2022-planar")
WIDE = stiffness(5.0), stiffness(75.0)


def onset(robot):
    return bifurcations(robot, K1, WIDE, normal_form=False)[-1].point.value


def test_parts_are_means_over_all_orders():
    changes = ["body.mass=10 kg", "legs.half_width=6 cm", "springs.stiffness[1]=30 N*mm/deg"]
    found = compare(ROBOT, ROBOT.set_from_text(changes), quantities=("onset",))
    assert found.paths == ("body.mass", "springs.stiffness[1]", "legs.half_width")
    by_path = dict(zip(found.paths, range(3), strict=True))
    parts = np.zeros(3)
    for order in itertools.permutations(changes):
        for count, change in enumerate(order):
            step = onset(ROBOT.set_from_text(order[: count + 1])) - onset(ROBOT.set_from_text(order[:count]))
            parts[by_path[change.partition("=")[0]]] += step / 6.0
    effects = found.effects["onset"]
    assert effects.mean == pytest.approx(parts, rel=1e-7)
    assert effects.mean.sum() == pytest.approx(effects.second - effects.first, rel=1e-9)
    alone = onset(ROBOT.set_from_text(changes[:1])) - onset(ROBOT)
    assert effects.alone[by_path["body.mass"]] == pytest.approx(alone, rel=1e-7)
    last = onset(ROBOT.set_from_text(changes)) - onset(ROBOT.set_from_text(changes[1:]))
    assert effects.last[by_path["body.mass"]] == pytest.approx(last, rel=1e-7)
    assert not effects.error.any()


def test_many_differences_are_changed_in_sampled_orders():
    paths = ["body.mass", "body.length", "legs.half_width", "legs.forward_offset", "gait.stride", "ground.friction"]
    paths += [f"springs.stiffness[{joint}]" for joint in range(1, 5)]
    other = ROBOT
    for count, path in enumerate(paths):
        other = other.with_value(path, (1.0 + 0.002 * count) * ROBOT.get(path) + 1e-4)
    found = compare(ROBOT, other, quantities=("growth",))
    effects = found.effects["growth"]
    assert len(found.paths) == 10
    assert effects.mean.sum() == pytest.approx(effects.second - effects.first, rel=1e-9)
    # Small changes hardly depend on their order.
    assert effects.mean == pytest.approx(effects.alone, rel=0.1, abs=1e-4)
    assert "64 of the orders" in found.lines()[-1]


def test_parts_of_sampled_orders_have_intervals(monkeypatch):
    """The second of two changes has the whole effect: in half of the orders that is the first number."""
    low = ROBOT.body.mass, ROBOT.ground.friction

    def margin(self, robot):
        return float(robot.body.mass > low[0] and robot.ground.friction > low[1])

    monkeypatch.setattr(Measured, "margin", margin)
    paths = ["body.mass", "ground.friction", "body.length", "legs.half_width", "legs.forward_offset", "gait.stride"]
    other = ROBOT
    for count, path in enumerate([*paths, *(f"springs.stiffness[{joint}]" for joint in range(1, 5))]):
        other = other.with_value(path, 1.01 * ROBOT.get(path) + 1e-4 * count)
    found = compare(ROBOT, other, quantities=("margin",))
    mean, error = found.effects["margin"].mean, found.effects["margin"].error
    at = found.paths.index("body.mass")
    assert abs(mean[at] - 0.5) < error[at]
    assert error == pytest.approx(1.9983 * np.sqrt(mean * (1.0 - mean) / 63.0), rel=1e-4, abs=1e-12)  # Student's t
    assert "64 of the orders of the changes, ± half of their 95 % interval" in found.lines()[-1]


def test_nine_differences_take_no_more_robots_than_all_subsets(monkeypatch):
    asked = []
    monkeypatch.setattr(Measured, "margin", lambda self, robot: asked.append(robot) or robot.body.mass)
    paths = ["body.mass", "body.length", "legs.half_width", "legs.forward_offset", "ground.friction"]
    other = ROBOT
    for path in [*paths, *(f"springs.stiffness[{joint}]" for joint in range(1, 5))]:
        other = other.with_value(path, 1.01 * ROBOT.get(path) + (path == "springs.stiffness[4]") * 1e-4)
    found = compare(ROBOT, other, quantities=("margin",))
    effects = found.effects["margin"]
    assert (len(found.paths), len(asked)) == (9, 512)
    expected = [0.01 * ROBOT.body.mass if path == "body.mass" else 0.0 for path in found.paths]
    np.testing.assert_allclose(effects.mean, expected, rtol=1e-9, atol=1e-12)
    assert not effects.error.any()
    lines = found.lines()
    assert ("margin ()" in lines[1], "  and" in lines[0]) == (False, False)
    assert [line.split()[-1] for line in lines[3:11]] == ["0"] * 8


@pytest.mark.parametrize("springs", ["springs.stiffness[2]", "springs.stiffness[2:]"])
def test_a_number_that_one_of_the_robots_has_not_is_refused(springs):
    short, between = ROBOT.with_value("body.modules", 3), (0.1, 5.0)
    for pair in ((ROBOT, short), (short, ROBOT)):
        with pytest.raises(ParameterError, match=rf"^{short.name}: {re.escape(springs)}: must be "):
            compare(*pair, Onset(springs, between), ("onset",))


def test_planar_numbers_of_a_robot_with_a_twin_are_compared():
    found = compare(ROBOT, load_robot("aoi2022"), quantities=("onset",))
    assert set(found.paths) == {"legs.forward_offset", "legs.half_width", "ground.friction", "springs.damping"}
    assert found.effects["onset"].second == pytest.approx(onset(load_robot("aoi2022")), rel=1e-9)
    twins = compare(load_robot("aoi2022"), load_robot("aoi2022").with_value("twin.timestep", 1e-3))
    assert (twins.paths, twins.others) == ((), ("twin.timestep",))
    assert "no number that the planar model reads differs" in twins.lines()[1]


def test_other_numbers_of_modules_and_springs_that_are_not_there():
    longer = ROBOT.set_from_text(["body.modules=8", "springs.stiffness[6]=30 N*mm/deg"])
    found = compare(ROBOT, longer, quantities=("onset", "speed"))
    assert found.paths == ("body.modules", "springs.stiffness[6]")
    assert found.effects["onset"].mean.sum() == pytest.approx(onset(longer) - onset(ROBOT), rel=1e-9)
    assert abs(found.effects["onset"].alone[1]) < 1e-12
    assert not found.effects["speed"].mean.any()
    assert found.as_json()["differences_si"]["springs.stiffness[6]"] == [None, stiffness(30.0)]
    assert [row for row in found.lines() if row.split()[:2] == ["springs.stiffness[6]", "-"]]


def test_what_a_robot_in_between_has_not_is_unknown():
    found = compare(ROBOT, ROBOT.with_value("body.mass", 9.0), Onset(at=stiffness(20.0)), ("radius",))
    assert np.isnan(found.effects["radius"].mean).all()
    assert found.as_json()["quantities"]["radius"]["values_si"] == [None, None]
    assert found.lines()[-1].strip() == "unknown: not both robots have a value of radius"
    springs = Onset(between=(stiffness(20.0), stiffness(75.0)))
    lines = compare(ROBOT, ROBOT.with_value("body.mass", 9.0), springs, ("onset", "growth")).lines()
    assert "onset none and none, growth -0.235 1/s" in lines[0]
    with pytest.raises(ParameterError, match="radius"):
        compare(ROBOT, ROBOT, quantities=("radios",))


def test_robots_far_faster_than_both_are_not_computed(monkeypatch):
    """With the mass of the small one and the friction of the large one, a robot takes hundreds of times the steps."""
    asked = []
    monkeypatch.setattr(Measured, "margin", lambda self, robot: asked.append(robot) or 1.0)
    small = ROBOT.with_value("body.mass", 1e-3 * ROBOT.body.mass).with_value("ground.friction", 0.25)
    found = compare(ROBOT, small, quantities=("margin",))
    numbers = [(robot.body.mass, robot.ground.friction) for robot in asked]
    assert numbers == [(8.5, 246.5), (8.5e-3, 0.25), (8.5, 0.25)]
    assert np.isnan(found.effects["margin"].mean).all()
    assert "or its motion is far faster than theirs" in found.lines()[-1]


def test_robots_of_which_no_mean_is_left_are_not_computed(monkeypatch):
    asked = []

    def margin(self, robot):
        asked.append(robot)
        if robot.body.mass != ROBOT.body.mass:
            raise ParameterError("has none")
        return 1.0

    monkeypatch.setattr(Measured, "margin", margin)
    other, paths = ROBOT, ["body.mass", "body.length", "legs.half_width", "legs.forward_offset", "gait.stride"]
    for count, path in enumerate([*paths, "ground.friction", *(f"springs.stiffness[{at}]" for at in range(1, 5))]):
        other = other.with_value(path, 1.01 * ROBOT.get(path) + 1e-4 * count)
    found = compare(ROBOT, other, quantities=("margin",))
    assert len(found.paths) == 10
    assert np.isnan(found.effects["margin"].mean).all()
    assert len(asked) < 80


def test_a_long_comparison_is_announced(monkeypatch):
    monkeypatch.setattr(importlib.import_module("chilopod.analysis.compare"), "_LONG", -1.0)
    told = []
    compare(ROBOT, ROBOT.set_from_text(["body.mass=9 kg"]), quantities=("growth",), remark=told.append)
    assert len(told) == 1
    assert re.fullmatch(r"a quantity of up to 2 robots in between takes about \S+ minutes", told[0])


def test_each_robot_is_compared_at_its_own_spring():
    other = ROBOT.with_value(K1, stiffness(20.0))
    found = compare(ROBOT, other, quantities=("growth", "onset"))
    assert found.paths == (K1,)
    assert found.effects["growth"].second == leading_mode(other).growth
    assert found.effects["growth"].mean[0] > 0.05
    assert found.effects["onset"].mean[0] == pytest.approx(0.0, abs=1e-10)
    assert compare(ROBOT, other, Onset(at=stiffness(20.0)), ("growth",)).paths == ()
