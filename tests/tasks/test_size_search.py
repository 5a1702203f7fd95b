"""Search for free numbers: ends of ranges, robots without a quantity, and bounds on roots."""

import numpy as np
import pytest

from chilopod.analysis import Onset, sensitivity
from chilopod.analysis.map_axes import axis
from chilopod.analysis.parameters import K1, stiffness
from chilopod.analysis.quantities import Measured, leading_mode
from chilopod.errors import AnalysisError
from chilopod.progress import silent
from chilopod.robot import load_robot
from chilopod.tasks.sizing.search import Outcome, Search, Wish

ROBOT = load_robot("aoi2022-planar")
SPRING = (K1, "5 N*mm/deg", "60 N*mm/deg")


def search_for(wishes, *free, budget=1200):
    axes = tuple(axis(ROBOT, each, "free") for each in free)
    return Search(ROBOT, wishes, axes, Onset(), budget, 0, silent)


def test_an_end_is_named_although_least_squares_end_beside_it():
    """The growth rate falls along the range, and is the wished one beyond it, at 13.17 N*mm/deg."""
    search = search_for((Wish("growth", -0.05),), (K1, "5 N*mm/deg", "12 N*mm/deg"))
    outcome = search.run()
    said = "springs.stiffness[0] is at the upper end of its range, 12 N*mm/deg"
    assert (outcome, search.reasons(outcome)) == (Outcome.UNMET, ([said], []))
    assert search.numbers(search.best) == [search.axes[0].high]


@pytest.mark.parametrize("rounding", [0.0, 1e-11, -1e-11])
def test_rounding_decides_on_no_end(rounding, monkeypatch):
    def searched(wish, measured, robot):
        return 1.2 - robot.get(K1) / stiffness(11.0) + rounding * (robot.get(K1) == stiffness(11.0))

    monkeypatch.setattr(Wish, "searched", searched)
    search = search_for((Wish("margin", 0.5),), (K1, "7 N*mm/deg", "11 N*mm/deg"))
    (said,), _ = search.reasons(search.run())
    assert said == "springs.stiffness[0] is at the upper end of its range, 11 N*mm/deg"


def test_ends_of_ranges_are_met_exactly():
    ranges = np.random.default_rng(2).uniform(0.1, 3.0, (200, 2)).cumsum(axis=1).tolist()
    for low, high in (*ranges, (stiffness(10.0), stiffness(30.0)), (-0.3, 0.1), (0.0, 0.7)):
        search = search_for((Wish("growth", -1.0),), ("legs.forward_offset", low, high))
        places = [0.0, 1e-16, 0.3, 1.0 - 1e-15, 1.0 - 2e-16, 1.0]
        found = np.array([search.numbers(np.array([place]))[0] for place in places])
        assert (found[0], found[-1]) == (low, high)
        assert ((low <= found) & (found <= high)).all()


def test_no_end_is_cleared_where_the_evaluations_were_spent(monkeypatch):
    monkeypatch.setattr(Wish, "searched", lambda wish, measured, robot: 1.2 - robot.get(K1) / stiffness(11.0))
    search = search_for((Wish("margin", 0.5),), (K1, "7 N*mm/deg", "11 N*mm/deg"), budget=10)
    outcome = search.run()
    assert (outcome, search.reasons(outcome)) == (Outcome.BUDGET, ([], []))


def curving(monkeypatch):
    """A radius of 0.1 m over the root of the growth rate: 0.8 m at a rate of 1/64."""
    radius = lambda self, robot: 0.1 / np.sqrt(leading_mode(robot).growth)  # noqa: E731
    made_up = {"radius": radius, "speed": lambda self, robot: 0.1, "most_bent": lambda self, robot: 0.1}
    for name, function in made_up.items():
        monkeypatch.setattr(Measured, name, function)
    return Measured(Onset())


def test_a_robot_that_walks_straight_meets_no_wish_for_a_radius(monkeypatch):
    measured = curving(monkeypatch)
    for wish in (Wish("radius", 0.8, sense) for sense in (-1, 0, 1)):
        assert wish.curved
        assert wish.missed(wish.searched(measured, ROBOT)) == np.inf
    wishes = Wish("radius", 0.8, 1), Wish("speed", 0.09, 1)
    for wished in (wishes, wishes[:1]):
        search = search_for(wished, SPRING)
        assert search.run() is Outcome.MET
        assert 0.0 < leading_mode(search.at(search.best)).growth <= (1.0 + 3e-6) / 64.0
    straight = search_for(wishes, (K1, "13 N*mm/deg", "60 N*mm/deg"))
    assert straight.run() is Outcome.LACKING
    assert "without the wish for radius the others are met" in straight.reasons(Outcome.LACKING)[0]


def test_a_front_has_no_robots_without_a_wished_radius(monkeypatch):
    curving(monkeypatch)
    search = search_for((Wish("radius", 0.8, 1), Wish("growth", -0.01, -1)), SPRING)
    outcome = search.run()
    front = search.reasons(outcome)[1]
    assert outcome is Outcome.UNMET
    assert len(front) > 0
    assert all(leading_mode(search.at(place)).growth > 0.0 for place in front)


def test_the_bound_of_a_root_contains_its_residual_and_the_error_of_the_quantity(monkeypatch):
    """A quantity that rises by 2 per unit of the number: an error of 1e-6 moves the root by 5e-7."""
    monkeypatch.setattr(Measured, "growth", lambda self, robot: 2.0 * robot.get(K1) - 0.3)
    monkeypatch.setattr(Measured, "error", lambda self, name, robot: errors[0])
    search, errors = search_for((Wish("growth", 1.0),), (K1, 0.4, 1.0)), [1e-6]
    assert search.run() is Outcome.MET
    assert search.bound() == pytest.approx(2.0 * 0.5e-6, rel=0.2)
    errors[0] = 0.0
    search.best = search.best + 1e-6 / np.log(2.5)
    off = abs(search.numbers(search.best)[0] - 0.65)
    assert off == pytest.approx(search.bound() / 2.0, rel=1e-3)
    for errors[0] in (np.nan, 1.0):  # not known, and larger than the slope is resolved by
        assert np.isnan(search.bound())


def test_a_root_beside_a_cliff_has_no_bound(monkeypatch):
    def growth(self, robot):
        if robot.get(K1) > 0.65 * (1.0 + 1e-9):
            raise AnalysisError("has no such quantity", field="growth")
        return 2.0 * robot.get(K1) - 0.3

    monkeypatch.setattr(Measured, "growth", growth)
    search = search_for((Wish("growth", 1.0),), (K1, 0.4, 1.0))
    search.best = np.array([np.log(0.65 / 0.4) / np.log(2.5)])
    assert np.isnan(search.bound())


def test_a_spring_of_a_growth_rate_agrees_with_an_independent_model():
    """A Taylor method in long double arithmetic gives this spring."""
    search = search_for((Wish("growth", -0.03),), SPRING)
    assert search.run() is Outcome.MET
    off = abs(search.numbers(search.best)[0] - 0.73149409681732362654)
    assert 4e-16 < search.bound() < 1e-9
    assert off <= search.bound()


def test_the_influence_of_friction_is_a_derivative():
    """The same model gives the derivative at the robot itself, and the half-width at which it is 0.2."""
    wide = ROBOT.with_value("legs.half_width", 0.12307114992)
    for robot, known in ((ROBOT, 0.18152415631), (wide, 0.2)):
        measured = Measured(Onset())
        assert measured.friction(robot) == pytest.approx(known, abs=measured.error("friction", robot), rel=0.0)
        assert 0.0 < measured.error("friction", robot) < 1e-7
    changes = sensitivity(ROBOT, quantities=("onset",), paths=["ground.friction"]).percent("onset")
    assert Measured(Onset()).friction(ROBOT) == pytest.approx(changes["ground.friction"], rel=1e-9)
    replaced = Measured(Onset("ground.friction", (10.0, 300.0)))
    assert replaced.friction(ROBOT.with_value(K1, stiffness(11.0))) == 0.0
