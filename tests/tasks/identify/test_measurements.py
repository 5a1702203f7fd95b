"""What further measurements would leave open of the planar constants."""

import dataclasses
import json

import numpy as np
import pytest

from chilopod.cli import main
from chilopod.errors import AnalysisError
from chilopod.paper.printed import critical_mode_data
from chilopod.robot import load_robot
from chilopod.tasks import identify
from chilopod.tasks.identify import (
    Measurement,
    NextMeasurements,
    SelfTest,
    check,
    next_measurements,
    planar_fit,
    self_test,
)
from chilopod.tasks.identify.measurements import usual

ROBOT = load_robot("aoi2022-planar")
DATA = critical_mode_data()


def test_the_exact_projection_shrinks_as_predicted_by_the_best_measurement_and_not_by_the_worst(found, monkeypatch):
    words = "mode, other springs", "critical k1, ", "legs.forward_offset itself"
    chosen = [each for each in usual(found) if each.name.startswith(words)]
    ranked = next_measurements(found, chosen).rows
    assert len(ranked) == len(chosen)
    assert ranked[0]["measurement"] == "mode, other springs = 20.5 N*mm/deg"
    assert ranked[-1]["measurement"] == "critical k1, module phase 180 deg"
    constants, made = np.array([found.best.get(path) for path in planar_fit.FREE]), {each.name: each for each in chosen}
    for row in (ranked[0], ranked[-1]):

        class Residuals(planar_fit._Residuals):
            def __call__(self, scaled, row=row):
                robot = planar_fit.with_constants(self._robot, scaled * self._scale)
                off = (made[row["measurement"]].of(robot) - row["predicted_si"]) / row["tolerances_si"]
                return np.append(super().__call__(scaled), off)

        with monkeypatch.context() as patch:
            patch.setattr(planar_fit, "_Residuals", Residuals)
            there = planar_fit.allowed_ranges(ROBOT, DATA, constants)[0]
        left = np.ptp(there, axis=1) / np.ptp(found.ranges, axis=1)
        np.testing.assert_allclose(left, [*row["range_left"].values()], atol=0.04)
    assert max(ranked[0]["range_left"].values()) < 0.8
    assert min(ranked[-1]["range_left"].values()) > 0.99


def test_a_radius_at_which_the_robot_folds_up_is_left_out(found, monkeypatch):
    chosen = [each for each in usual(found) if each.name.startswith("radius, k1 = 7")]
    assert next_measurements(found, chosen).rows
    monkeypatch.setattr("chilopod.analysis.quantities.Measured.most_bent", lambda self, robot: 1.6)
    ranked = next_measurements(found, chosen)
    assert not ranked.rows
    assert "more than a right angle" in ranked.left_out[chosen[0].name]


def test_a_radius_is_that_of_a_branch_that_first_rises_beyond_its_onset(found, monkeypatch):
    """As that of a subcritical onset does; it is followed in the interval of the data, not just beyond the onset."""
    asked = []
    monkeypatch.setattr("chilopod.analysis.quantities.Measured._followed", lambda self, *_: asked.append(self) or 1 / 0)
    for each in usual(found):
        if each.name.startswith("radius"):
            with pytest.raises(ZeroDivisionError):
                each.of(found.best)
    assert [each.number.between[1] for each in asked] == [DATA.between[1]] * 3


def test_measurements_of_known_effect(found):
    def no_effect(robot):
        return np.array([1.0])

    def jumps(robot):
        return np.array([1.0 + (robot.legs.half_width > found.best.legs.half_width)])

    def nothing(robot):
        return np.array([0.0])

    def infinite(robot):
        return np.array([np.inf])

    friction = Measurement("friction itself", lambda robot: np.array([robot.ground.friction]), 1e-9)
    useless, rough = Measurement("useless", no_effect, 0.1), Measurement("jumps", jumps, 0.1)
    given = [useless, rough, friction, *(Measurement(each.__name__, each, 0.1) for each in (nothing, infinite))]
    ranked = next_measurements(found, given, free=["ground.friction", "legs.half_width"])
    first, last = ranked.rows
    assert (first["measurement"], last["measurement"]) == ("friction itself", "useless")
    assert first["range_left"]["ground.friction"] < 1e-6
    assert first["volume_left"] < 1e-6
    np.testing.assert_allclose([last["volume_left"], *last["range_left"].values()], 1.0, atol=1e-9)
    assert {*ranked.left_out} == {"jumps", "nothing", "infinite"}
    assert "friction itself" in str(ranked)


def test_a_self_test_counts_and_robots_depend_on_their_number_alone(monkeypatch):
    # Where a range would be found from rounded numbers it is nothing, and everything from scattered ones.
    monkeypatch.setattr(check, "_fitted", lambda robot, data: (data, np.zeros(3)))
    monkeypatch.setattr(planar_fit, "allowed_ranges", lambda robot, data, best: (np.full((3, 2), np.nan), None))
    seen = []

    def everything(robot, data, best):
        seen.append(data)
        return np.tile([0.0, np.inf], (3, 1)), None

    monkeypatch.setattr(planar_fit, "confidence_intervals", everything)
    assert check.rounded(DATA.model_copy(update={"k1": 1.02 * DATA.k1})) == DATA
    both, first = self_test(ROBOT, DATA, 2, seed=3), self_test(ROBOT, DATA, 1, seed=3)
    np.testing.assert_array_equal(both.true[:1], first.true)
    assert seen[0] == seen[2] != seen[1]
    counts = both.as_json()
    assert [each["covered"] for each in counts["rounded"].values()] == [0, 0, 0]
    assert [each["covered"] for each in counts["scattered"].values()] == [2, 2, 2]
    low, high = counts["scattered"]["ground.friction"]["share"]
    assert (low, high) == (pytest.approx(0.025**0.5), 1.0)  # Clopper and Pearson: two of two
    assert "ground.friction" in str(both)


def test_a_tolerance_of_k1_that_rounds_it_to_nothing_is_refused():
    with pytest.raises(AnalysisError, match="the tolerance of k1 must leave a spring above 0"):
        self_test(ROBOT, DATA.model_copy(update={"k1_tolerance": 2.0 * DATA.k1}), 1)


def test_a_fault_of_a_robot_that_is_made_up_names_it():
    other, *_ = check.made_up(ROBOT, DATA, np.random.default_rng(0))
    with pytest.raises(AnalysisError, match="robot = 'a robot that is made up': must have a pitchfork between"):
        check._fitted(other, DATA.model_copy(update={"between": (1e3, 2e3)}))


def test_data_that_leave_a_combination_open_bound_nothing(found):
    # The spring and the mode of three modules are two numbers for three constants.
    robot, far = ROBOT.with_value("body.modules", 3), (0.5 * DATA.k1, 5.0 * DATA.k1)
    spring, mode = planar_fit.searched(robot, far)
    data = DATA.model_copy(update={"k1": spring, "components": tuple(mode), "between": far})
    assert np.isnan(
        planar_fit.confidence_intervals(robot, data, np.array([robot.get(path) for path in planar_fit.FREE]))[0]
    ).all()
    with pytest.raises(AnalysisError, match="the data must bound all combinations of the constants"):
        next_measurements(dataclasses.replace(found, given=robot, data=data), [])
    with pytest.raises(AnalysisError, match="the tolerances must explain the residuals"):
        next_measurements(dataclasses.replace(found, spread=np.full((3, 3), np.nan)), [])


def test_the_command_ranks_measurements_and_tests_itself(found, tmp_path, monkeypatch, capsys):
    ranked, tested = NextMeasurements([], {"a push": "none"}), SelfTest(np.ones((1, 3)), *np.zeros((2, 1, 3, 2)))
    for name, answer in (("identify_planar", found), ("next_measurements", ranked), ("self_test", tested)):
        monkeypatch.setattr(identify, name, lambda *_, answer=answer, **__: answer)
    monkeypatch.setattr("chilopod.show.figures.identification.panel", lambda found: None)
    monkeypatch.setattr("chilopod.show.files.panel_files", lambda *_: [])
    arguments = ["identify", "planar", "--next", "--check", "1", "--out", str(tmp_path)]
    assert main([*arguments, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (printed["next"], printed["check"]) == (ranked.as_json(), tested.as_json())
    assert main([*arguments, "--force"]) == 0
    out = capsys.readouterr().out
    assert "left out: a push: none" in out
    assert "self-test, 1 robots" in out


def test_an_identification_is_written_though_nothing_tells_what_to_measure_and_no_robot_tests_it(
    found, tmp_path, monkeypatch, capsys
):
    def untested(*_, **__):
        raise AnalysisError("robot must have neighbours with a pitchfork")

    open_ = dataclasses.replace(found, spread=np.full((3, 3), np.nan))
    monkeypatch.setattr(identify, "identify_planar", lambda *_, **__: open_)
    monkeypatch.setattr(identify, "self_test", untested)
    monkeypatch.setattr("chilopod.show.figures.identification.panel", lambda found: None)
    monkeypatch.setattr("chilopod.show.files.panel_files", lambda *_: [])
    arguments = ["identify", "planar", "--next", "--check", "1", "--out", str(tmp_path)]
    assert main([*arguments, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["next"] == {"problem": "as standard errors the tolerances must explain the residuals"}
    assert printed["check"] == {"problem": "robot must have neighbours with a pitchfork"}
    assert printed["constants"]["ground.friction"]["value_si"] == found.constants[0]
    assert (tmp_path / "identified.toml").exists()
    assert main([*arguments, "--force"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("aoi2022-planar: largest residual 0.7")
    assert "no result of --next: as standard errors the tolerances must explain the residuals\n" in out
    assert "no result of --check: robot must have neighbours with a pitchfork\n" in out
