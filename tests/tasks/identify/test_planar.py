"""The planar model's constants from the critical spring and its mode."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import least_squares

from chilopod.analysis.parameters import K1, stiffness
from chilopod.analysis.straight_walk import bifurcations
from chilopod.errors import AnalysisError, ParameterError, RobotFileError, UnitError
from chilopod.paper.printed import critical_mode_data
from chilopod.robot import load_robot
from chilopod.show.figures import identification
from chilopod.tasks.identify import TEMPLATES, CriticalMode, RecordedWalks, load_data, planar, planar_fit

ROBOT = load_robot("aoi2022-planar")
DATA = critical_mode_data()
BEST = np.array([ROBOT.get(path) for path in planar_fit.FREE])


def test_residuals_need_the_number_of_modules_of_the_data():
    with pytest.raises(AnalysisError, match="must be 6"):
        planar_fit.residuals(ROBOT.with_value("body.modules", 7), DATA)


def test_a_robot_without_a_pitchfork_is_refused(monkeypatch):
    # Of such a robot every search ends where it began.
    monkeypatch.setattr(planar_fit, "bifurcations", lambda *_, **__: [])
    with pytest.raises(AnalysisError, match="must have a pitchfork between k1 = 4 N"):
        planar.identify_planar(ROBOT, DATA)


def met(constants):
    return np.abs(planar_fit.residuals(planar_fit.with_constants(ROBOT, constants), DATA)).max()


def test_ranges_are_the_projection_of_what_the_tolerances_allow(found):
    ranges = found.ranges
    # By a program of its own, with sequential linear programming.
    np.testing.assert_allclose(ranges, [[227.695, 259.59], [0.0622, 0.08558], [0.03524, 0.06359]], rtol=1e-3)
    # A random walk within the set stays within the ranges, and comes far along the valley.
    rng, here, seen = np.random.default_rng(1), BEST, [BEST]
    for _ in range(40):
        there = here + rng.normal(size=3) * [6.0, -0.006, -0.006] * rng.uniform()
        here = there if met(there) <= 1.0 else here
        seen.append(here)
    seen = np.array(seen)
    assert (seen >= ranges[:, 0]).all()
    assert (seen <= ranges[:, 1]).all()
    assert np.ptp(seen[:, 0]) > 0.2 * np.ptp(ranges[0])


def test_the_group_of_the_critical_spring_is_that_of_the_robot_with_the_constants(found):
    (value, *ends), *others = found.groups().values()
    robot, gait = found.best, found.best.gait
    spring = planar_fit.searched(robot, DATA.between)[0]
    assert value == pytest.approx(spring / (robot.ground.friction * gait.speed * gait.duty * robot.module_length))
    # By a program of its own; with k1 of the data in place of the robot's they would be 0.2354 and 0.2684.
    np.testing.assert_allclose(ends, [0.2257, 0.2751], atol=1e-4)
    lengths = np.array([found.constants[1:], *found.ranges[1:].T]).T / robot.module_length
    np.testing.assert_allclose(others, lengths)


def modelled(monkeypatch, model):
    """Robots with a pitchfork of known spring, over that of the data, and mode, of constants in their own units, whose
    two components have data 0.6 and 0.8."""
    robot = ROBOT.with_value("body.modules", 3)
    data = DATA.model_copy(update={"components": (0.6, 0.8), "component_tolerance": 0.02})
    scale = planar_fit.scale_of(robot, data)

    def beside(self, other):
        spring, *mode = model(*(np.array([other.get(path) for path in planar_fit.FREE]) / scale))
        return spring * data.k1, np.array(mode)

    def searched(other, between):
        found = beside(None, other)
        return found if between[0] <= found[0] <= between[1] else None

    monkeypatch.setattr(planar_fit.Pitchforks, "__call__", beside)
    monkeypatch.setattr(planar_fit, "searched", searched)
    return robot, data, scale


def test_the_group_ends_where_the_mode_does_if_friction_makes_up_for_the_spring(monkeypatch):
    robot, data, scale = modelled(
        monkeypatch, lambda friction, width, offset: (friction * width * offset, width, offset)
    )
    best = np.array([1.0 / 0.48, 0.6, 0.8]) * scale
    ranges, cut = planar_fit.allowed_ranges(robot, data, best, goals=4)
    low, high, part = 0.58 * 0.78, 0.62 * 0.82, data.k1_tolerance / data.k1
    expected = [[(1.0 - part) / high, (1.0 + part) / low], [0.58, 0.62], [0.78, 0.82], [low, high]]
    np.testing.assert_allclose(ranges / np.append(scale, 0.25)[:, None], expected, rtol=1e-5)
    assert not cut.any()
    contrary = data.model_copy(update={"components": (-0.6, 0.8)})
    assert np.isnan(planar_fit.allowed_ranges(robot, contrary, best, goals=4)[0]).tolist() == [[True, True]] * 4


def test_a_fit_that_contradictory_data_pull_out_of_their_interval_ends_within(monkeypatch):
    """The mode asks for 0.6 of the spring of the data, whose interval ends at 0.9 of it."""
    robot, data, scale = modelled(monkeypatch, lambda friction, width, offset: (friction, width, 0.2 + friction))
    data = data.model_copy(update={"between": (0.9 * data.k1, 2.0 * data.k1)})
    constants, off = planar_fit._fit(robot, data, np.array([1.5, 0.45, 0.3]) * scale)
    np.testing.assert_allclose(constants[:2] / scale[:2], [0.9, 0.6], rtol=1e-6)
    np.testing.assert_allclose(off, [-0.1 * data.k1 / data.k1_tolerance, 0.0, 0.3 / 0.02], atol=1e-4)


def test_ranges_hold_the_constants_of_a_robot_of_another_size():
    settings = ["body.length=0.45 m", "body.mass=2 kg", "gait.stride=1 cm", "springs.stiffness=2 N*mm/deg"]
    robot, true = ROBOT.set_from_text(settings), np.array([90.0, 0.02, 0.012])
    interval = (stiffness(0.1), stiffness(5.0))
    *_, point = bifurcations(planar_fit.with_constants(robot, true), K1, interval, normal_form=False)
    mode = point.joint_components.real * np.sign(point.joint_components.real.sum())
    rounded = CriticalMode(
        k1=stiffness(round(point.value, 2)), k1_tolerance=stiffness(0.005), between=interval,
        components=np.round(mode, 2), component_tolerance=0.005,
    )  # fmt: skip
    ranges = planar_fit.allowed_ranges(robot, rounded, true)[0]
    assert ((ranges[:, 0] <= true) & (true <= ranges[:, 1])).all()


def test_a_range_that_the_bound_of_another_constant_cuts_says_so(monkeypatch):
    """Within its own bounds the friction of a robot of three modules ends, below, where the forward offset is at its
    bound; above, the data end it."""
    settings = ["body.modules=3", "body.length=6 cm", "body.mass=10 g", "springs.stiffness=0.000219 N*m/rad"]
    settings += ["legs.forward_offset=4.4 mm", "legs.half_width=5.4 mm", "ground.friction=0.92 N*s/m"]
    settings += ["gait.stride=6 mm", "gait.stance=0.2 s", "gait.swing=0.15 s", "gait.module_phase=90 deg"]
    data = CriticalMode(
        k1=4.9e-5, k1_tolerance=5e-7, between=(2.2e-5, 2.2e-4), components=(0.99, 0.15), component_tolerance=0.005
    )
    monkeypatch.setattr(planar, "_profile", lambda *_: xr.Dataset())
    found = planar.identify_planar(ROBOT.set_from_text(settings), data)
    texts = [each["allowed_text"].partition("(")[2] for each in found.as_json()["constants"].values()]
    assert texts[:2] == ["lower end cut by the range searched)", "cut by the range searched)"]
    # Two places are within 0.2 % of the least offset: one at the bound of the half-width, and one that the data set.
    assert texts[2] in ("upper end cut by the range searched)", "cut by the range searched)")
    assert (
        found.lines()[-3].strip().startswith("ranges searched: ground.friction 0.0286 N*s/m to 11.4 N*s/m, legs.half")
    )
    assert found.lines()[-1].strip() == "too few data for 3 constants: 2 independent numbers, as the mode has norm 1"


def test_data_that_contradict_each_other_allow_nothing():
    data = CriticalMode(**{**dict(DATA), "components": DATA.components[::-1]})
    ranges = planar_fit.allowed_ranges(ROBOT, data, BEST)[0]
    assert np.isnan(ranges).all()


def test_data_with_tiny_tolerances_have_a_profile_and_a_figure():
    """Residuals of all constants are large then, and not those of a robot without a pitchfork."""
    mode = DATA.components / np.linalg.norm(DATA.components)
    data = CriticalMode(**{**dict(DATA), "components": mode, "component_tolerance": 1e-9})
    found = planar.identify_planar(ROBOT, data, points=3)
    assert np.isnan(found.ranges).all()
    noted = found.estimates.identified("mine.toml").provenance
    assert all(noted[path].endswith("90 %: none found; no constants meet all data") for path in planar_fit.FREE)
    assert [each["interval_si"] for each in found.as_json()["constants"].values()] == [None] * 3
    assert found.as_json()["combinations"] == []
    assert "do not explain these residuals" in found.lines()[-1]
    assert np.isfinite(found.profile.friction).all()
    assert (found.profile.largest_residual > 1e4).all()
    assert identification.panel(found).draw(True).axes


def test_a_figure_is_drawn_without_any_prediction(found):
    names = "friction", "half_width", "largest_residual"
    rows = dict.fromkeys(names, np.ones(3)) | {name: np.full(3, x) for name, x in planar._no_predictions({}).items()}
    profile = xr.Dataset(
        {name: ("forward_offset", row) for name, row in rows.items()}, {"forward_offset": [0.0, 1.0, 2.0]}
    )
    assert identification.panel(replace(found, profile=profile)).draw(False).axes


def test_the_axis_of_critical_springs_suits_those_of_a_small_robot(found):
    names = "friction", "half_width", "largest_residual"
    rows = dict.fromkeys(names, np.ones(3)) | {name: np.full(3, x) for name, x in planar._no_predictions({}).items()}
    rows["critical_k1"] = 8.5e-4 * np.array([0.99, 1.0, 1.01])
    profile = xr.Dataset(
        {name: ("forward_offset", row) for name, row in rows.items()}, {"forward_offset": [0.0, 1.0, 2.0]}
    )
    low, high = identification.panel(replace(found, profile=profile)).draw(False).axes[3].get_ylim()
    assert 8e-4 < low < 8.5e-4 < high < 9e-4


def test_a_search_ends_among_robots_without_a_pitchfork(monkeypatch):
    """They are slow to compute, and say nothing of where pitchforks are."""
    tried = []

    def pitchfork(self, robot):
        tried.append(robot)
        return None

    rng = np.random.default_rng(0)
    monkeypatch.setattr(planar_fit.Pitchforks, "__call__", pitchfork)

    def minimize(fun, start, constraints, **rest):
        for _ in range(1000):
            constraints["fun"](start + rng.uniform(0.0, 1.0, start.shape))
        raise AssertionError

    monkeypatch.setattr(planar_fit, "minimize", minimize)
    bounds = np.array(planar_fit._BOUNDS) * planar_fit.scale_of(ROBOT, DATA)[:, None]
    np.testing.assert_array_equal(planar_fit.allowed_ranges(ROBOT, DATA, BEST)[0], bounds)  # no end is found
    assert len(tried) <= 7 * (planar_fit._MOST_LOST + 2)


def test_every_end_of_a_wide_valley_is_found():
    """Linear constraints point among robots without a pitchfork, from which no search comes back."""
    data = CriticalMode(**{**dict(DATA), "component_tolerance": 0.1})
    best = planar_fit.best_of(planar_fit.fits_from_every_start(ROBOT, data))[0]
    ends = planar_fit.confidence_intervals(ROBOT, data, best)[0]
    assert np.isfinite(ends).all()
    assert (ends[:, 0] < best).all()
    assert (best < ends[:, 1]).all()


def test_a_profile_ends_where_no_pitchfork_is_left(monkeypatch):
    """Beyond, each search would begin with nothing, among constants that are slow to compute."""
    tried, nothing = [], planar_fit.no_pitchfork(DATA)

    def fitted(robot, data, start):
        tried.append(start[2])
        return start

    def off(robot, data):
        gone = robot.get("legs.forward_offset") > BEST[2] + 0.002
        return nothing if gone else np.full(6, 0.5)

    monkeypatch.setattr(planar_fit, "least_largest", fitted)
    monkeypatch.setattr(planar, "residuals", off)
    monkeypatch.setattr(planar, "_predictions", lambda robot, variants: planar._no_predictions(variants))
    span = BEST[2] + np.array([-0.01, 0.01])
    profile = planar._profile(ROBOT, DATA, BEST, span, 11, {}, lambda part, said: None)
    gone = profile.forward_offset.values > BEST[2] + 0.002
    assert len(tried) == 11 - gone.sum() + 1
    np.testing.assert_array_equal(profile.largest_residual, np.where(gone, nothing.max(), 0.5))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(profile.friction)), np.flatnonzero(gone)[1:])


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("k1_tolerance", -1.0), ("k1", np.nan), ("component_tolerance", 0.0), ("between", (40.0, 4.0)),
        ("components", (6.0,) * 5), ("components", 0.93 * np.array(DATA.components)),
    ],
)  # fmt: skip
def test_data_that_are_none_are_refused(field, value):
    with pytest.raises((ParameterError, UnitError), match=field):
        CriticalMode(**{**dict(DATA), field: value})


def test_a_norm_that_no_tolerance_explains_is_refused():
    """Tolerances may be standard errors, of which the norm has one."""
    with pytest.raises(ParameterError, match=r"components = .*: must have the norm 1, not 0.936"):
        CriticalMode(**{**dict(DATA), "components": (0.2, 0.9, 0.16)})
    mode = np.array(DATA.components) / np.linalg.norm(DATA.components)
    assert CriticalMode(**{**dict(DATA), "components": (1.0 + 2.9 * DATA.component_tolerance) * mode})


def test_a_mode_is_a_direction():
    assert CriticalMode(**{**dict(DATA), "components": [-each for each in DATA.components]}) == DATA


def test_the_template_is_read_as_the_papers_data(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(TEMPLATES["planar"])
    assert load_data(file, CriticalMode, RecordedWalks) == DATA
    file.write_text(TEMPLATES["planar"].replace("12 N*mm/deg", "50 N*mm/deg"))
    with pytest.raises(
        RobotFileError, match=r"mine.toml: between = .*: must hold k1; allowed: two rising springs with k1 = 50 N"
    ):
        load_data(file, CriticalMode, RecordedWalks)
    file.write_text(TEMPLATES["planar"].replace("component_tolerance", "component_tolerances"))
    with pytest.raises(RobotFileError, match="unknown key; did you mean 'component_tolerance'"):
        load_data(file, CriticalMode, RecordedWalks)
    file.write_text(TEMPLATES["planar"] + '[free]\n"ground.friction" = ["100 N*s/m", "500 N*s/m"]\n')
    with pytest.raises(RobotFileError, match=r"free: belongs to other data than between, .*: give one kind"):
        load_data(file, CriticalMode, RecordedWalks)


def test_no_direction_changes_the_residuals_less_than_the_least_known_combination(found):
    *_, open_ = (np.array([*each["changes"].values()]) for each in found.as_json()["combinations"] if not each["open"])
    off = planar_fit.residuals(ROBOT, DATA)

    def change(direction):
        there = BEST * (1.0 + 1e-4 * direction / np.linalg.norm(direction))
        return np.linalg.norm(planar_fit.residuals(planar_fit.with_constants(ROBOT, there), DATA) - off)

    others = np.random.default_rng(1).normal(size=(40, 3))
    assert change(open_) < 1.01 * min(change(each) for each in others)
    # Half of the 90 % interval of linear residuals.
    assert change(open_) == pytest.approx(1e-4 * 1.645 / np.linalg.norm(open_), rel=0.02)


def test_newtons_method_finds_what_a_search_finds_with_its_derivatives():
    scale = planar_fit.scale_of(ROBOT, DATA)
    off, start = planar_fit._Residuals(ROBOT, DATA), BEST / scale
    off(start)

    def at(scaled):
        return planar_fit.residuals(planar_fit.with_constants(ROBOT, scaled * scale), DATA)

    for there in (start * np.array([1.1, 1.05, 0.9]), start):
        np.testing.assert_allclose(off(there), at(there), atol=1e-9)
    moves = 1e-4 * np.eye(3)
    slopes = np.array([(at(start + move) - at(start - move)) / 2e-4 for move in moves]).T
    np.testing.assert_allclose(off.jacobian(start), slopes, atol=1e-5 * np.abs(slopes).max())


def test_an_interval_ends_where_chi_square_of_the_best_others_has_grown_by_its_level():
    scale, (best, off) = planar_fit.scale_of(ROBOT, DATA), planar_fit._fit(ROBOT, DATA, BEST)
    for constant, ends in enumerate(planar_fit.confidence_intervals(ROBOT, DATA, best)[0]):
        others = [index for index in range(3) if index != constant]
        for end in ends:

            def residuals(free, end=end, constant=constant, others=others):
                there = np.empty(3)
                there[constant], there[others] = end, free * scale[others]
                return planar_fit.residuals(planar_fit.with_constants(ROBOT, there), DATA)

            least = 2.0 * least_squares(residuals, (best / scale)[others], diff_step=1e-5).cost
            assert least - (off**2).sum() == pytest.approx(2.7055, abs=0.01)
