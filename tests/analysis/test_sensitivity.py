"""What each number of a robot does to its onset of bending, and how sure that is."""

import json
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.stats.qmc import Sobol

from chilopod.analysis import Onset, bifurcations, compare, curved_walks, sensitivity, uncertainty
from chilopod.analysis.derivatives import derivative
from chilopod.analysis.parameters import ALL, K1, check_parameter, numbers_read, stiffness
from chilopod.analysis.quantities import leading_mode
from chilopod.analysis.uncertainty import sobol_shares
from chilopod.errors import AnalysisError, ParameterError
from chilopod.robot import load_robot
from chilopod.stability import Kind

ROBOT = load_robot("aoi2022-planar")
ROBOT_ONSET = Onset().first(ROBOT).point.value
STEP = 2e-5  # relative, of the differences that derivatives are compared with


@pytest.mark.parametrize(
    ("function", "at", "exact"),
    [(np.exp, 1.0, np.e), (lambda x: x * abs(x) + 3.0 * x, 0.0, 3.0), (lambda x: x**2.5, 2.0, 2.5 * 2.0**1.5)],
)
def test_a_derivative_is_within_its_error(function, at, exact):
    slope, error = derivative(lambda x: np.array(function(x)), at, 1.0)
    assert abs(slope - exact) <= error < 1e-6


def test_at_the_end_of_a_range_a_derivative_is_towards_its_inside():
    def inside(x):
        if x < 0.0:
            raise ParameterError("is out of range")
        return np.array(np.sin(x) + x**2)

    slope, error = derivative(inside, 0.0, 1.0)
    assert abs(slope - 1.0) <= error < 1e-6
    with pytest.raises(AnalysisError, match="out of range"):
        derivative(lambda x: inside(x if x == 0.0 else -1.0), 0.0, 1.0)


@pytest.mark.parametrize("name", ["aoi2022-planar", "aoi2022"])
def test_derivatives_of_the_onset_agree_with_differences_of_located_points(name):
    robot = load_robot(name)
    paths = [path for path in numbers_read(robot) if path != K1 and robot.get(path)]
    found = sensitivity(robot, quantities=("onset",), paths=paths)
    k = float(found.values[0])
    near = 0.99 * k, 1.01 * k

    def located(path, value):
        (point,) = bifurcations(robot.with_value(path, value), K1, near, normal_form=False)
        return point.point.value

    for path, change in found.percent("onset").items():
        value = robot.get(path)
        changes = []
        for step in (STEP, 0.5 * STEP):
            after, before = (located(path, value * (1.0 + sign * step)) for sign in (1.0, -1.0))
            changes.append((after - before) / (2.0 * step * k))
        assert change == pytest.approx(2.0 * changes[1] - changes[0], rel=1e-6, abs=1e-7), path


def test_derivatives_of_growth_and_frequency_agree_with_differences():
    # All springs alike and soft: the body undulates.
    robot = ROBOT.with_value(ALL, stiffness(6.0))
    assert leading_mode(robot).frequency > 0.3
    found = sensitivity(robot, quantities=("growth", "frequency"))
    for path, slope in found.of("growth").items():
        step = 0.1 * STEP * (robot.get(path) or 1.0)
        after, before = (
            leading_mode(robot.with_value(path, max(0.0, robot.get(path) + s * step))) for s in (1.0, -1.0)
        )
        across = step if robot.get(path) == 0.0 else 2.0 * step
        assert slope == pytest.approx((after.growth - before.growth) / across, rel=1e-4, abs=1e-6), path
        turned = (after.frequency - before.frequency) / across
        assert found.of("frequency")[path] == pytest.approx(turned, rel=1e-4, abs=1e-6), path


def test_derivatives_of_the_radius_agree_with_branches_of_other_robots():
    at, path = stiffness(9.0), "springs.stiffness[1]"
    found = sensitivity(ROBOT, Onset(at=at), ("radius",), [path])
    radii = []
    for sign in (1.0, -1.0):
        walks = curved_walks(ROBOT.with_value(path, ROBOT.get(path) * (1.0 + 1e-3 * sign)), K1, (at, stiffness(15.0)))
        radii.append(float(walks.axis_radius[-1]))
    assert found.percent("radius")[path] == pytest.approx((radii[0] - radii[1]) / 2e-3 / found.values[0], rel=1e-4)
    with pytest.raises(AnalysisError, match="stable there"):
        sensitivity(ROBOT, quantities=("radius",), paths=[path])


def test_the_coefficient_of_the_normal_form_has_derivatives_within_their_errors():
    found = sensitivity(ROBOT, quantities=("coefficient",), paths=["legs.half_width"])
    # Differences of located points by a script of 2026-11-26, steps of 0.1 to 0.8 %, extrapolated: 0.0745878.
    assert 100.0 * found.percent("coefficient")["legs.half_width"] == pytest.approx(0.0745878, abs=2e-7)
    assert found.errors[0, 0] * ROBOT.get("legs.half_width") < 1e-6


def test_a_number_without_which_there_is_no_coefficient_costs_no_other_derivative():
    # Legs that are not half a period apart leave no symmetry, and so no pitchfork with a cubic coefficient.
    found = sensitivity(ROBOT, quantities=("coefficient", "onset"), paths=["legs.half_width", "gait.side_phase"])
    assert np.isnan(found.of("coefficient")["gait.side_phase"])
    assert found.of("onset")["gait.side_phase"] == pytest.approx(0.0, abs=1e-9)
    assert np.isfinite(found.of("coefficient")["legs.half_width"])
    assert "  no derivative: coefficient by gait.side_phase" in found.lines()
    plain = json.loads(json.dumps(found.as_json(), allow_nan=False))
    assert plain["coefficient"]["derivatives_si"]["gait.side_phase"] is None
    assert plain["coefficient"]["value_si"] < 0.0


def test_what_does_not_enter_has_no_effect():
    # The onset is a value of this spring, whatever the robot's is: what is found is rounding, within its error.
    found = sensitivity(ROBOT, quantities=("friction",), paths=[K1, "ground.friction"])
    assert abs(found.of("friction")[K1]) <= found.errors[0, 0]
    lines = found.lines()
    assert f"  no effect to first order: {K1}" in lines
    assert "friction (per %)" in lines[1]


def test_an_onset_of_springs_alike_does_not_depend_on_each():
    found = sensitivity(ROBOT, Onset(ALL), ("onset",), ["springs.stiffness[2]", "body.mass"])
    assert found.of("onset")["springs.stiffness[2]"] == 0.0
    assert abs(found.of("onset")["body.mass"]) > 1e-4


def test_its_summary_and_its_json_say_the_same():
    found = sensitivity(ROBOT, quantities=("onset", "frequency"), paths=["body.mass", "springs.damping[0]"])
    lines, plain = found.lines(), found.as_json()
    assert "onset 11.991 N*mm/deg (bends)" in lines[0]
    assert any(line.split()[:2] == ["body.mass", "8.5"] for line in lines)
    assert any("springs.damping[0] is 0: onset changes by" in line for line in lines)
    assert plain["onset"]["percent_per_percent"]["body.mass"] == found.percent("onset")["body.mass"]
    axes = found.plot(Figure().add_subplot())
    assert len(axes.patches) == 1
    assert axes.get_xlabel() == "change of the onset by 1 % of a number (%)"


def test_an_onset_says_what_the_straight_walk_does_beyond_it():
    others = "springs.stiffness[1:]"
    found = sensitivity(ROBOT, Onset(others), ("onset",), ["body.mass"])
    (there,) = bifurcations(ROBOT, others, (0.99 * found.values[0], 1.01 * found.values[0]), normal_form=False)
    assert there.point.kind is Kind.NEIMARK_SACKER
    assert found.title.endswith(" N*mm/deg (undulates)")
    assert found.as_json()["onset"]["fate"] == "undulates"
    first = sensitivity(ROBOT, quantities=("onset",), paths=["body.mass"])
    assert (first.title.split()[-1], first.as_json()["onset"]["fate"]) == ("(bends)", "bends")
    both = compare(ROBOT, ROBOT.with_value("body.mass", 9.0), Onset(others), ("onset",))
    assert both.title.count("(undulates)") == 2
    assert both.as_json()["quantities"]["onset"]["fates"] == ["undulates"] * 2


def test_what_is_not_known_is_refused():
    with pytest.raises(ParameterError, match="onset"):
        sensitivity(ROBOT, quantities=("onsets",))
    with pytest.raises(ParameterError, match=r"body\.mass"):
        sensitivity(ROBOT, paths=["body.mas"])
    with pytest.raises(AnalysisError, match="no loss of stability"):
        sensitivity(ROBOT, Onset(between=(stiffness(20.0), stiffness(75.0))))
    with pytest.raises(AnalysisError, match="unstable at both ends"):
        sensitivity(ROBOT, Onset(between=(stiffness(2.0), stiffness(9.0))))
    with pytest.raises(AnalysisError, match="more than a right angle"):  # engines end that walk
        sensitivity(ROBOT, Onset(at=stiffness(3.0)), ("radius",), ["body.mass"])
    for wrong in ((), "onset"):
        with pytest.raises(ParameterError, match="must be names"):
            sensitivity(ROBOT, quantities=wrong)
    for wrong in ((2.0, 1.0), (np.nan, 1.0)):
        with pytest.raises(ParameterError, match="must rise and be finite"):
            Onset(between=wrong)


@pytest.mark.parametrize(
    ("parameter", "between", "spring"),
    [
        ("legs.forward_offset", (0.0, 0.1), 12.0),  # it bends as this number rises
        ("legs.forward_offset", (-0.04, 0.1), 12.0),
        ("ground.friction", (10.0, 300.0), 11.0),
        ("gait.stride", (0.01, 0.05), 12.0),
    ],
)
def test_robots_that_bend_as_a_number_rises(parameter, between, spring):
    robot, onset = ROBOT.with_value(K1, stiffness(spring)), Onset(parameter, between)
    found = onset.first(robot).point.value
    (point,) = bifurcations(robot, parameter, (0.9 * found, 1.1 * found), normal_form=False)
    assert found == pytest.approx(point.point.value, rel=1e-10)
    assert leading_mode(robot.with_value(parameter, 0.99 * found)).growth < 0.0
    assert leading_mode(robot.with_value(parameter, 1.01 * found)).growth > 0.0
    assert onset.beside(robot.with_value("body.mass", 8.6), found) == pytest.approx(found, rel=0.1)
    # The critical spring there is the robot's: one derivative is the inverse of the other.
    slope = sensitivity(robot, onset, ("onset",), [K1]).of("onset")[K1]
    back = sensitivity(robot.with_value(parameter, found), Onset(), ("onset",), [parameter]).of("onset")[parameter]
    assert slope == pytest.approx(1.0 / back, rel=1e-6)


def test_an_interval_may_touch_zero():
    robot = ROBOT.with_value(K1, stiffness(11.98))
    found = Onset("springs.damping", (0.0, 1.0)).first(robot)
    assert found.point.value == pytest.approx(bifurcations(robot, "springs.damping", (0.0, 1.0))[0].point.value)


def test_onsets_of_similar_robots_are_those_of_a_whole_search():
    onset = Onset()
    first = onset.first(ROBOT).point.value
    for override in (["body.mass=10 kg"], ["legs.forward_offset=2 cm"], ["springs.stiffness=28 N*mm/deg"]):
        robot = ROBOT.set_from_text(override)
        assert onset.beside(robot, first) == pytest.approx(onset.first(robot).point.value, rel=1e-10)


class TestUncertainty:
    def test_small_tolerances_spread_the_onset_as_derivatives_say(self):
        paths = ["legs.half_width", "ground.friction", "springs.stiffness[2]"]
        found = uncertainty(ROBOT, {path: 0.01 * ROBOT.get(path) for path in paths}, samples=64)
        assert found.deviation == pytest.approx(found.propagated, rel=0.05)
        assert found.failed == 0
        assert found.interval[0] < found.value < found.interval[1]
        changes = np.array([sensitivity(ROBOT, paths=paths).percent("onset")[path] for path in paths])
        assert found.shares.total == pytest.approx(changes**2 / (changes**2).sum(), abs=0.1)

    def test_onsets_of_two_kinds_are_counted(self):
        robot, second = ROBOT.with_value("body.modules", 5), "springs.stiffness[1]"
        numbers = {"body.length": 4.0, "body.mass": 100.0, "ground.friction": 900.0, "legs.forward_offset": 0.2}
        numbers |= {"gait.stride": 0.12, ALL: stiffness(900.0), second: stiffness(630.0)}
        for path, value in numbers.items():
            robot = robot.with_value(path, value)
        found = uncertainty(robot, {second: stiffness(190.0)}, samples=16)
        counts = {fate.label: count for fate, count in found.fates.items()}
        assert {*counts} == {"bends", "undulates"}
        assert sum(counts.values()) == np.isfinite(found.sampled).sum()
        assert found.as_json()["fates"] == counts
        assert any(f"undulates in {counts['undulates']}" in line and "mix" in line for line in found.lines())

    def test_robots_without_an_onset_are_counted_and_do_not_count(self):
        onset = Onset(between=(stiffness(11.9), stiffness(75.0)))
        found = uncertainty(ROBOT, {"springs.stiffness[1]": 0.2 * ROBOT.get(K1)}, onset, samples=16)
        assert 0 < found.failed < found.evaluations == 48
        assert np.isnan(found.sampled).any()
        assert found.sampled[np.isfinite(found.sampled)].min() >= onset.between[0]
        assert any(f"{found.failed} of 48 robots" in line for line in found.lines())
        assert found.as_json()["failed"] == found.failed

    def test_shares_of_a_known_function_lie_within_their_intervals(self):
        """Ishigami's function; a fifth of the samples fail. Shares: Saltelli et al. 2008, Global Sensitivity Analysis,
        section 4.6."""

        def ishigami(x):
            return np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0])

        first, total = np.array([0.3139, 0.4424, 0.0]), np.array([0.5576, 0.4424, 0.2437])
        inside = []
        for seed in range(12):
            rng = np.random.default_rng(seed)
            points = np.pi * (2.0 * Sobol(6, rng=rng).random(256) - 1.0)
            a, b = points[:, :3].T, points[:, 3:].T
            values = [
                ishigami(each) for each in (a, b, *(np.where(np.arange(3)[:, None] == i, b, a) for i in range(3)))
            ]
            for each in values:
                each[rng.random(each.size) < 0.2] = np.nan
            shares = sobol_shares(values[0], values[1], np.array(values[2:]), rng)
            inside += ((shares.first_ends[:, 0] <= first) & (first <= shares.first_ends[:, 1])).tolist()
            inside += ((shares.total_ends[:, 0] <= total) & (total <= shares.total_ends[:, 1])).tolist()
            assert np.ptp(shares.first_ends, axis=1).max() < 0.8
        assert np.mean(inside) > 0.85
        assert np.isnan(sobol_shares(values[0][:8], values[1][:8], np.array(values[2:])[:, :8], rng).first).all()

    def test_without_any_onset_it_says_so(self):
        onset = Onset(between=(ROBOT_ONSET * (1.0 - 1e-9), stiffness(75.0)))
        found = uncertainty(ROBOT, {"body.mass": 1e-9}, onset, samples=16)
        none = replace(found, sampled=np.full(32, np.nan), failed=48)
        assert "no sample has one" in str(none)
        assert none.as_json()["deviation_sampled_si"] is None

    def test_wrong_samples_and_tolerances_are_refused(self):
        for tolerances, more, said in (
            ({}, {}, "name a number"),
            ({"body.mass": -1.0}, {}, "positive"),
            ({K1: 0.1}, {}, "critical value"),
            ({"body.mass": 0.1}, {"samples": 100}, "power of two"),
            ({"body.mass": 0.1}, {"samples": 2**30}, "power of two"),
            ({"body.mass": np.inf}, {}, "finite"),
            ({"body.mass": 20.0}, {}, r"body\.mass"),
            ({"springs.damping[0]": 1e-3}, {}, r"springs\.damping"),
        ):
            with pytest.raises(ParameterError, match=said):
                uncertainty(ROBOT, tolerances, **more)


@pytest.mark.parametrize(("modules", "inertia"), [(6, None), (9, None), (9, "0.02 kg*m^2")])
def test_numbers_of_the_twin_are_read_where_they_change_the_planar_robot(modules, inertia):
    robot = load_robot("aoi2022").with_value("body.modules", modules)
    robot = robot.override("body.yaw_inertia", inertia) if inertia else robot
    twin = [path for path in robot.parameters() if path.startswith("twin.") and robot.get(path)]
    changed = set()
    for path in twin:
        with suppress(ParameterError):  # a count of time steps
            other = robot.with_value(path, 1.001 * robot.get(path))
            changed |= {path} if other.module_yaw_inertia != robot.module_yaw_inertia else set()
    assert {path for path in numbers_read(robot) if path.startswith("twin.")} == changed
    assert len(changed) == (6 if (modules, inertia) == (9, None) else 0)
    with pytest.raises(ParameterError, match="must be a number that the planar model reads") as caught:
        check_parameter(robot, "twin.sliding_friction")
    assert ("twin." in str(caught.value.allowed)) == bool(changed)
