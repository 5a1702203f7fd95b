"""Sizing: robots that do what is wished, in theory and in walks."""

import json
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from chilopod.analysis import Onset, bifurcations, curved_walks
from chilopod.analysis.map_axes import axis
from chilopod.analysis.parameters import K1, stiffness
from chilopod.analysis.quantities import Measured, leading_mode
from chilopod.errors import AnalysisError, ChilopodError
from chilopod.progress import silent
from chilopod.robot import Robot, load_robot
from chilopod.tasks import size, sizing
from chilopod.tasks.sizing import parsed_wish
from chilopod.tasks.sizing.search import FAILED, Outcome, Search, Wish
from chilopod.trials import NONE, Trial, run, summaries

ROBOT = load_robot("aoi2022-planar")
SPRING = (K1, "5 N*mm/deg", "60 N*mm/deg")


def walked(robot, seconds=900.0):
    """Radius and speed at the end of a walk that is begun otherwise than those of the task."""
    (record,) = run([Trial(robot, seconds, joint_angles=(-0.1,), disturbance=NONE, rate=20.0)])
    (end,) = summaries(robot, record)
    step = float(record.time[1] - record.time[0])
    way = record.position.isel(robot=0).transpose("time", "axis").values
    cycle = round(robot.gait.period / step)
    way = way[-1 - 40 * cycle :: cycle]
    return end.axis_radius, np.linalg.norm(np.diff(way, axis=0), axis=1).mean() / (cycle * step)


@pytest.fixture(scope="module")
def paper():
    return size(ROBOT, {"radius": "0.88 m"}, [SPRING])


def test_the_spring_of_the_papers_radius_is_that_of_the_branch(paper):
    (spring,) = paper.numbers
    assert paper.outcome is Outcome.MET
    assert paper.bound < 1e-8 * spring
    walks = curved_walks(ROBOT, K1, (spring, stiffness(15.0)))
    assert float(walks.parameter_si[-1]) == spring
    # The radius rises by some 2.5 m for a change of the spring by its own size; orbits are accurate to 1e-10.
    assert float(walks.axis_radius[-1]) == pytest.approx(0.88, abs=1e-8)
    assert walked(paper.robot)[0] == pytest.approx(0.88, rel=0.01)
    assert paper.walks["planar"].axis_radius.item() == pytest.approx(0.88, rel=0.01)


def test_its_robot_says_what_was_computed_and_what_was_copied(paper):
    robot = Robot.from_toml(paper.robot.to_toml())
    assert robot.get(K1) == paper.numbers[0]
    assert robot.provenance_of(K1).startswith("computed: chilopod size, radius 0.88 m, springs.stiffness[0] within 5")
    assert robot.provenance_of("body.mass") == "copied from aoi2022-planar: " + ROBOT.provenance_of("body.mass")
    assert all(robot.get(path) == ROBOT.get(path) for path in ROBOT.parameters() if path != K1)
    plain = json.loads(json.dumps(paper.as_json(), allow_nan=False))
    assert (plain["outcome"], plain["numbers_si"][K1]) == ("met", paper.numbers[0])
    assert paper.plot(Figure().add_subplot()).get_xlabel() == "place in the range"
    assert "±" in paper.lines()[2]


@pytest.mark.parametrize(
    ("changed", "met", "said"),
    [
        ({"axis_radius": 0.3}, False, "; the twin's radius is 0.3 m"),
        ({"direction": "straight"}, False, "; the twin's walk goes straight"),
        ({"axis_radius": 0.87}, True, ""),
    ],
)
def test_what_the_twin_misses_is_in_title_and_json(paper, changed, met, said):
    found = replace(paper, walks={**paper.walks, "twin": paper.walks["planar"].assign(**changed)})
    assert found.title == f"aoi2022-planar: every wish is met in the planar model{said}"
    printed = found.as_json()
    assert (printed["outcome"], printed["model"]) == ("met", "planar")
    assert printed["wishes"][0]["met_by_walk"] == {"planar": True, "twin": met}
    onset = replace(found, wishes=(Wish("onset", 0.1, -1),))  # which no walk shows
    assert onset.title == "aoi2022-planar: every wish is met in the planar model"
    assert onset.as_json()["wishes"][0]["met_by_walk"] == {"planar": None, "twin": None}


def test_the_figure_has_range_value_and_wishes(paper):
    axes = paper.plot(Figure().add_subplot())
    (label,) = (each.get_text().split("\n") for each in axes.get_yticklabels())
    assert label[:2] == [K1, "5 N*mm/deg to 60 N*mm/deg"]
    assert float(label[2].split(" ")[0]) == pytest.approx(paper.numbers[0] / stiffness(1.0), rel=1e-9)
    assert "radius 0.88 m: found 0.88 m, planar walk 0.88" in axes.get_title()


def test_random_wishes_are_met_when_walked():
    radius, speed = np.random.default_rng(1).uniform((0.5, 0.05), (1.3, 0.15))
    found = size(ROBOT, {"radius": radius, "speed": speed}, [SPRING, ("speed", "0.03 m/s", "0.3 m/s")])
    assert found.outcome is Outcome.MET
    assert found.values == pytest.approx([radius, speed], rel=1e-5)
    assert walked(found.robot) == (pytest.approx(radius, rel=0.02), pytest.approx(speed, rel=0.02))


def test_an_onset_is_that_of_a_search(paper):
    wished = stiffness(9.0)
    found = size(ROBOT, {"onset": "9 N*mm/deg"}, [("springs.stiffness[1:]", "20 N*mm/deg", "60 N*mm/deg")])
    near = 0.9 * wished, 1.1 * wished
    assert bifurcations(found.robot, K1, near, normal_form=False)[-1].point.value == pytest.approx(wished, rel=1e-9)
    assert found.walks["planar"].direction.item() == "straight"


def test_a_wish_that_nobody_meets_says_what_stands_in_the_way():
    short = size(ROBOT, {"growth": 1.0}, [SPRING])
    assert short.outcome is Outcome.UNMET
    assert "springs.stiffness[0] is at the lower end of its range, 5 N*mm/deg" in short.reasons
    assert short.values[0] == pytest.approx(leading_mode(ROBOT.with_value(K1, stiffness(5.0))).growth, rel=1e-2)
    both = size(ROBOT, {"growth": -0.1, "speed": 0.2}, [SPRING])
    assert both.outcome is Outcome.UNMET
    assert any("without the wish for speed the others are met" in each for each in both.reasons)
    assert any("Pareto front" in line for line in both.lines())
    assert both.front.shape[1] == 3
    steps = np.abs(np.diff(both.front[:, 0])) / np.ptp(both.front[:, 0])
    assert (steps > 1e-4).all()  # no place twice
    axes = both.plot(Figure().add_subplot())
    assert axes.get_legend()
    assert {axes.get_xlabel(), axes.get_ylabel()} == {"growth (1/s)", "speed (m/s)"}
    onset = replace(both, wishes=(Wish("onset", stiffness(14.0)), both.wishes[1])).plot(Figure().add_subplot())
    assert "onset (N*mm/deg)" in {onset.get_xlabel(), onset.get_ylabel()}
    assert max(float(line.get_data()["xy".index(k)].max()) for line in onset.lines for k in "xy") == pytest.approx(14.0)


def test_no_place_of_a_front_is_surpassed_by_another(monkeypatch):
    """Onsets from p = 1/2 on meet their limit alike; of these the growth is least at p = 0.7 and q = 0."""

    def made_up(search, place, measured):
        p, q = place
        return np.array([max(0.5 - p, 0.0), 0.2 + (p - 0.7) ** 2 + q**2])

    def left_out(search, wish, start):
        place = np.array([0.6, 0.3])
        return place, made_up(search, place, None)

    monkeypatch.setattr(Search, "_found", made_up)
    monkeypatch.setattr(Search, "_left_out", left_out)
    axes = tuple(axis(ROBOT, each, "free") for each in (SPRING, ("legs.forward_offset", "10 mm", "60 mm")))
    search = Search(ROBOT, (Wish("onset", 0.1, 1), Wish("growth", -1.0, -1)), axes, Onset(), 1200, 0, silent)
    outcome = search.run()
    front = np.array(search.reasons(outcome)[1])
    assert outcome is not Outcome.MET
    np.testing.assert_allclose(front, len(front) * [[0.7, 0.0]], atol=5e-3)
    assert len(front) > 0


def test_a_walk_that_settles_for_hours_is_said_to_be_settling():
    """The settling time grows without bound towards the onset."""
    found = size(ROBOT, {"radius": "5 m"}, [SPRING])
    assert found.outcome is Outcome.SLOW
    assert found.values == pytest.approx([5.0])


def test_a_walk_lasts_as_many_gait_cycles_in_any_unit_of_time():
    class Measure:
        def settling(self, robot):
            return 20.0 * robot.gait.period

    for factor in (1e-3, 1.0, 1e3):
        texts = [f"gait.stance={0.31 * factor} s", f"gait.swing={0.29 * factor} s"]
        assert sizing._cycles(ROBOT.set_from_text(texts), Measure()) == pytest.approx(300.0)


def test_a_walk_that_has_not_settled_is_said_so(monkeypatch):
    """Its bend grows by less than 5 % in 10 s, and goes on growing."""

    def growing(trials):
        record = run([replace(trials[0], duration=6.0)])[0]
        times = np.arange(901) / 10.0
        record = record.isel(time=np.zeros(times.size, dtype=int)).assign_coords(time=times)
        record["joint_angle"] = record.joint_angle * 0.0 + 0.2 * np.exp(0.004 * record.time)
        record["position"] = record.position + 0.1 * record.time
        return [record]

    monkeypatch.setattr(sizing, "run", growing)
    found = size(ROBOT, {"speed": "<0.2 m/s"}, [SPRING])
    assert found.lines()[-1] == "  the planar walk turns right, not settled yet"
    assert found.as_json()["walks"]["planar"]["settled"] is False


def test_a_robot_that_bends_too_far_has_no_curved_walk(monkeypatch):
    """The same verdict as that of `sensitivity`, also for limits."""
    robot, bent = ROBOT.with_value(K1, stiffness(8.0)), [1.5]
    monkeypatch.setattr(Measured, "radius", lambda self, robot: 0.5)
    monkeypatch.setattr(Measured, "speed", lambda self, robot: 0.1)
    monkeypatch.setattr(Measured, "most_bent", lambda self, robot: bent[0])
    measured, wishes = Measured(Onset()), [Wish("radius", 0.5), Wish("radius", 0.6, -1), Wish("speed", 0.1)]
    assert [wish.searched(measured, robot) for wish in wishes] == [0.0, 0.0, 0.0]
    bent[0] = 1.6
    assert [wish.searched(measured, robot) for wish in wishes] == [-FAILED] * 3
    assert [wish.of(measured, robot) for wish in wishes] == pytest.approx([np.nan] * 3, nan_ok=True)
    assert wishes[0].missed(-FAILED) == np.inf
    with pytest.raises(AnalysisError, match="more than a right angle"):
        measured.walked("radius", robot)


def test_the_tightest_walk_in_range_is_nearest_to_a_tighter_one(monkeypatch):
    def searched(wish, measured, robot):
        spring = robot.get(K1) / stiffness(10.0)
        return 0.1 * spring if spring > 1.7 else -FAILED

    monkeypatch.setattr(Wish, "searched", searched)
    search = Search(ROBOT, (Wish("radius", 0.1),), (axis(ROBOT, SPRING, "free"),), Onset(), 1200, 0, silent)
    outcome = search.run()
    assert outcome is Outcome.UNMET
    assert search.numbers(search.best) == pytest.approx([stiffness(17.0)], rel=1e-9)
    said = "some robots are left out: the curved walk bends a joint by more than a right angle"
    assert search.reasons(outcome) == ([said], [])


def conflicting(monkeypatch, made_up):
    monkeypatch.setattr(Search, "_found", lambda search, place, measured: made_up(*place))
    axes = tuple(axis(ROBOT, each, "free") for each in (SPRING, ("legs.forward_offset", "0 mm", "60 mm")))
    search = Search(ROBOT, (Wish("onset", 0.1), Wish("growth", -1.0)), axes, Onset(), 1200, 0, silent)
    return search, *search.reasons(search.run())


def test_an_end_of_a_range_is_named_where_the_robot_stands_at_it(monkeypatch):
    """Least squares end beside it; the other number stays beside its end, as it does best there."""
    search, said, _ = conflicting(monkeypatch, lambda p, q: np.array([0.3 + (p - 5e-4) ** 2, 0.2 + q]))
    assert search.best == pytest.approx([5e-4, 0.0], abs=1e-4)
    assert search.best[1] == 0.0
    assert [each for each in said if "end of its range" in each] == [
        "legs.forward_offset is at the lower end of its range, 0 mm"
    ]


def test_no_place_of_a_front_is_nearer_than_the_nearest(monkeypatch):
    """Of two valleys searches from the starts find one; the other is found where a wish is left out."""

    def left_out(search, wish, start):
        place = np.array([0.9, 0.1])
        return place, search.deviations(place)

    monkeypatch.setattr(Search, "_left_out", left_out)
    narrow = lambda p, q: 0.1 if abs(p - 0.9) + abs(q - 0.1) < 1e-3 else 0.0  # noqa: E731
    search, _, front = conflicting(monkeypatch, lambda p, q: np.array([0.3 - narrow(p, q), 0.2 + (p - 0.5) ** 2 * q]))
    sizes = [np.linalg.norm(search._found(place, None)) for place in front]
    assert np.linalg.norm(search._found(search.best, None)) == pytest.approx(min(sizes), rel=1e-12)


def test_limits_and_budgets():
    gentle = size(ROBOT, {"margin": ">50%", "settling": "<6 s"}, [SPRING])
    assert gentle.outcome is Outcome.MET
    (about,) = gentle.reasons
    assert about.startswith("the onset of springs.stiffness[0] is 11.99")
    assert about.endswith(" N*mm/deg (bends)")
    assert gentle.wishes[0] == Wish("margin", 0.5, 1)
    assert gentle.values[0] >= 0.5
    assert gentle.values[1] <= 6.0
    spent = size(ROBOT, {"growth": -0.1, "onset": stiffness(30.0)}, [SPRING], budget=3)
    assert spent.outcome is Outcome.BUDGET
    assert spent.evaluations <= 3
    assert Wish("growth", 0.0).deviation(0.5) == 0.5
    assert [Wish("radius", 1.0, -1).deviation(value) for value in (0.5, 2.0)] == [0.0, 1.0]


def test_quantities_agree_with_other_computations():
    spring = stiffness(9.0)
    robot, measured = ROBOT.with_value(K1, spring), Measured(Onset())
    walks = curved_walks(ROBOT, K1, (spring, stiffness(15.0)))
    both = []
    for _ in range(2):  # from the branch, and corrected
        names = "radius", "speed", "settling", "work"
        both.append([(getattr(measured, name)(robot), measured.error(name, robot)) for name in names])
        assert measured.radius(robot) == pytest.approx(float(walks.axis_radius[-1]), rel=1e-9)
        assert measured.speed(robot) == pytest.approx(float(walks.speed[-1]), rel=1e-9)
        slowest = -ROBOT.gait.period / np.log(float(walks.multiplier[-1]))
        assert measured.settling(robot) == pytest.approx(slowest, rel=1e-6)
        measured.radius(robot.with_value("body.mass", 8.6))
    assert measured.branches == 1
    onset = Onset().first(ROBOT).point.value
    assert measured.margin(robot) == pytest.approx(spring / onset - 1.0, rel=1e-9)
    angle = float(walks.mean_angle[-1, 0])
    assert measured.work(robot) == pytest.approx(0.5 * angle**2 * (onset - spring), rel=1e-6)
    (first, second), errors = np.array(both)[..., 0], np.array(both)[..., 1]
    assert (np.abs(first - second) <= errors.sum(axis=0)).all()
    assert (errors < 1e-8 * np.abs(first)).all()
    bound = Onset().first(robot).point.error_bound
    assert bound <= measured.error("onset", robot) <= 1.01 * bound
    assert measured.error("margin", robot) == pytest.approx(bound * spring / onset**2, rel=0.01)


def test_shares_are_wishes_without_a_unit():
    assert parsed_wish(ROBOT, Onset(), "margin", "-30%") == Wish("margin", pytest.approx(-0.3))
    with pytest.raises(ChilopodError, match=r"^growth = '30%'"):
        parsed_wish(ROBOT, Onset(), "growth", "30%")


def test_what_is_no_wish_or_no_range_is_refused():
    for wishes, free, said in (
        ({}, [SPRING], "wishes"),
        ({"radios": 1.0}, [SPRING], "did you mean 'radius'"),
        ({"radius": -1.0}, [SPRING], "positive"),
        ({"radius": "1 kg"}, [SPRING], "is a mass"),
        ({"radius": 1.0}, [], "free"),
        ({"radius": 1.0}, [("modules", 5, 8)], "continuous"),
        ({"radius": 1.0}, [SPRING, ("springs.stiffness", 0.3, 3.0)], "another range"),
        ({"radius": 1.0}, [("body.mass", -1.0, 3.0)], r"body\.mass"),
    ):
        with pytest.raises(ChilopodError, match=said):
            size(ROBOT, wishes, free)
    for more in ({"twin": True}, {"budget": 0}):
        with pytest.raises(ChilopodError, match=next(iter(more))):
            size(ROBOT, {"radius": 1.0}, [SPRING], **more)


def test_a_limit_has_no_error_bound():
    found = size(ROBOT, {"speed": "<0.2 m/s"}, [SPRING])
    assert found.outcome is Outcome.MET
    assert np.isnan(found.bound)


def test_a_wish_that_no_free_number_changes_is_named():
    found = size(ROBOT, {"onset": "12.5 N*mm/deg"}, [SPRING])
    assert found.outcome is Outcome.UNMET
    assert "no free number changes the onset" in found.reasons
    assert found.numbers[0] == pytest.approx(ROBOT.get(K1))
    met = size(ROBOT, {"onset": found.values[0]}, [SPRING])
    assert met.outcome is Outcome.MET
    assert np.isnan(met.bound)
    assert "no free number changes the onset" in met.reasons


def test_curved_walks_beside_a_stable_straight_one_are_said_not_to_be_searched():
    robot = ROBOT.override("gait.module_phase", "100 deg")
    found = size(robot, {"radius": "0.6 m"}, [("springs.stiffness[0]", "11.4 N*mm/deg", "11.5 N*mm/deg")], budget=12)
    assert found.outcome is not Outcome.MET
    assert any("subcritical" in reason for reason in found.reasons)
    other = size(ROBOT, {"radius": "0.6 m"}, [("springs.stiffness[0]", "13 N*mm/deg", "14 N*mm/deg")], budget=12)
    assert not any("subcritical" in reason for reason in other.reasons)
    assert other.title == "aoi2022-planar: no robot that was tried has every wished quantity"
    assert "the evaluations of the search were spent" in other.reasons
    assert not any("no free number changes" in reason for reason in other.reasons)
    uneven = ROBOT.override("gait.side_phase", "150 deg")
    found = size(uneven, {"radius": "0.6 m"}, [("gait.side_phase", "150 deg", "152 deg")], budget=12)
    assert any("no pitchfork (transcritical)" in reason for reason in found.reasons)


def test_a_radius_of_a_gait_without_mirror_symmetry_is_refused_at_once(monkeypatch):
    uneven, said = ROBOT.override("gait.side_phase", "170 deg"), r"^radius: the onset is transcritical, and no pair"
    monkeypatch.setattr(Search, "run", None)
    for wished in ("0.8 m", "<0.8 m", ">0.8 m"):
        with pytest.raises(AnalysisError, match=said):
            size(uneven, {"radius": wished, "speed": "0.1 m/s"}, [SPRING])
    with pytest.raises(AnalysisError, match=r"^work: the onset"):
        size(uneven, {"work": "1 mJ"}, [SPRING])


@pytest.mark.parametrize("budget", [1, 20, 50, 130])
def test_a_budget_is_kept_by_the_search_and_what_follows(budget, monkeypatch):
    """A branch of curved walks counts as 20; only the robot that is returned is computed once more."""
    asked = []

    def searched(wish, measured, robot):
        if measured.near is None and robot.get(K1) < stiffness(12.0):
            measured._following()
            asked.append(20)
            measured.near = np.zeros(13), np.eye(13)
        asked.append(0.5)
        return (robot.get(K1) / stiffness(10.0) - 1.0) * (1.0 if wish.quantity == "radius" else -2.0) + 0.1

    monkeypatch.setattr(Wish, "searched", searched)
    axes = (axis(ROBOT, SPRING, "free"),)
    search = Search(ROBOT, (Wish("radius", 0.8), Wish("speed", 0.1)), axes, Onset(), budget, 0, silent)
    search.reasons(search.run())
    assert sum(asked) <= search.evaluations <= budget


def test_an_onset_that_is_met_is_the_first_one():
    """Along the interval the multiplier of the spring is critical more than once: the wish is for the first loss."""
    texts = ["body.modules=4", "body.length=20 mm", "body.mass=2 g", "legs.half_width=2 mm", "legs.forward_offset=1 mm"]
    texts += ["gait.stride=1 mm", "gait.stance=0.05 s", "gait.swing=0.05 s", "ground.friction=0.05 N*s/m"]
    tiny = ROBOT.set_from_text([*texts, "springs.stiffness=1e-8 N*m/rad"])
    onset, (low, high) = stiffness(2e-5), (stiffness(3e-6), stiffness(3e-5))
    found = size(tiny, {"onset": onset}, [("legs.forward_offset", 0.0, 0.003)], onset=Onset(K1, (low, high)))
    assert found.outcome is not Outcome.MET or found.values[0] == pytest.approx(onset, rel=1e-5)
    assert found.outcome is Outcome.UNMET  # where 2e-5 is critical, the walk is unstable at both ends
    found = size(tiny, {"onset": onset}, [("legs.forward_offset", 0.0, 0.003)], onset=Onset(K1, (low, 1.25 * onset)))
    assert found.values[0] == pytest.approx(onset, rel=1e-5)
    # The onset has a bound of its own; the slope is that of onsets on both sides.
    (offset,), step = found.numbers, 1e-6
    at = (tiny.with_value("legs.forward_offset", each) for each in (offset - step, offset, offset + step))
    less, here, more = (Onset(K1, (low, 1.25 * onset)).first(robot).point for robot in at)
    own = here.error_bound * 2.0 * step / abs(more.value - less.value)
    assert own <= found.bound <= 4.0 * own


def test_an_onset_that_jumps_is_no_crash():
    """Over the phase between modules the first loss jumps from 74 to 121 degrees as the spring rises."""
    number = Onset("gait.module_phase", tuple(np.radians([60.0, 130.0])))
    found = size(ROBOT, {"onset": np.radians(90.0)}, [(K1, "11.5 N*mm/deg", "13 N*mm/deg")], onset=number, budget=60)
    assert found.outcome is not Outcome.MET
    assert np.isfinite(found.values[0])


def test_a_cliff_does_not_stop_the_search(monkeypatch):
    """Robots below a parabola lack the quantities; the nearest one stands on it, at the root of 4 p^3 + 3.2 p - 3."""

    def beyond(search, place, measured):
        p, q = place
        return np.array([1.5 - p, q + 0.3]) if q >= p**2 else np.full(2, FAILED)

    monkeypatch.setattr(Search, "_found", beyond)
    axes = [axis(ROBOT, each, "free") for each in (SPRING, ("legs.forward_offset", "10 mm", "60 mm"))]
    search = Search(ROBOT, (Wish("onset", 0.1), Wish("growth", 1.0)), tuple(axes), Onset(), 1200, 0, silent)
    assert search.run() is not Outcome.MET
    p = np.roots([4.0, 0.0, 3.2, -3.0])[-1].real
    np.testing.assert_allclose(search.best, [p, p**2], atol=0.02)
