import json

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.studies import identify_twin
from chilopod.studies.identify_twin import RESIDUALS, SPRINGS, TwinIdentification, known, residuals, search
from chilopod.studies.twin_constants import FREE, SERVO_TIME, constants_of, with_constants
from chilopod.studies.twin_spread import unlike

ROBOT = load_robot("aoi2022")


def bends_by_law(onset=34.0, at_21=5 * 0.225 / 0.88):
    """Bends that follow a square root from an onset and have the printed sum at 21."""
    shape = np.array([0.64, 0.36, 0.48, 0.46, 0.16]) / 2.1
    root = np.sqrt(np.maximum(1.0 / np.array(SPRINGS) - 1.0 / onset, 0.0))
    summed = at_21 * root / root[SPRINGS.index(21.0)]
    return np.tile(summed[:, None] * shape, (2, 1, 1))


def test_the_papers_own_law_meets_the_data():
    found = dict(zip(RESIDUALS, residuals(ROBOT, bends_by_law()), strict=True))
    # The two printed radii and the printed onset agree with one square root but for their rounding.
    assert abs(found["onset"]) < 1e-6
    assert abs(found["radius at 21"]) < 1e-9
    assert abs(found["radius at 26"]) < 1.0
    assert found["straight at 41"] == found["straight at 75"] == found["curved at 28"] == found["steady"] == 0.0


def test_every_datum_counts():
    early = dict(zip(RESIDUALS, residuals(ROBOT, bends_by_law(onset=28.5)), strict=True))
    assert early["onset"] < -2.0
    assert early["curved at 28"] > 0.0
    stiff = bends_by_law()
    stiff[:, SPRINGS.index(41.0)] = 0.1
    assert residuals(ROBOT, stiff)[RESIDUALS.index("straight at 41")] > 5.0
    moving = bends_by_law()
    moving[0] *= 0.5
    assert residuals(ROBOT, moving)[RESIDUALS.index("steady")] > 0.0
    lost = bends_by_law()
    lost[1, 0] = np.nan
    assert (residuals(ROBOT, lost) > 10.0).all()


def test_constants_go_in_and_come_out():
    values = [each.value(0.3) for each in FREE]
    robot = with_constants(ROBOT, values)
    np.testing.assert_allclose(constants_of(robot), values, rtol=1e-12)
    assert robot.get("twin.servo_damping") == SERVO_TIME * robot.get("twin.servo_stiffness")
    for each in FREE:
        assert each.part(each.value(0.3)) == pytest.approx(0.3)
        assert each.low <= ROBOT.get(each.path) <= each.high


def test_a_search_that_was_stopped_goes_on_where_it_was(tmp_path, monkeypatch):
    asked = []

    def series(robot):
        asked.append(robot)
        return bends_by_law(onset=30.0 + 200.0 * robot.get("legs.forward_offset") / 2.0)

    monkeypatch.setattr(identify_twin, "base_series", series)
    whole = search(ROBOT, starts=1, generations=2, folder=tmp_path / "a")
    count = len(asked)
    assert count == 20

    class Stop(Exception):
        pass

    def stop(done, words):
        if done > 0.6:
            raise Stop

    with pytest.raises(Stop):
        search(ROBOT, starts=1, generations=2, folder=tmp_path / "b", progress=stop)
    before = len(asked)
    again = search(ROBOT, starts=1, generations=2, folder=tmp_path / "b")
    assert len(asked) - before == count - (before - count)
    for one, other in zip(whole, again, strict=True):
        np.testing.assert_array_equal(one.constants, other.constants)
    assert [fit.objective for fit in whole] == sorted(fit.objective for fit in whole)


def test_what_was_found_as_json():
    found = TwinIdentification(ROBOT, known()).as_json()
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    for path, (low, high) in TwinIdentification(ROBOT, known()).ranges().items():
        assert low <= found["constants"][path]["value_si"] <= high


def test_the_preset_is_the_best_of_the_known():
    fits = known()
    assert len(fits) >= 5
    assert all(fit.misfit <= 1.0 for fit in fits)
    np.testing.assert_allclose(constants_of(ROBOT), fits[0].constants, rtol=2e-3)  # it is rounded
    chosen = unlike(fits, 4)
    assert chosen[0] is fits[0]
    assert len({id(fit) for fit in chosen}) == 4


@pytest.mark.slow
def test_the_preset_meets_the_base_series():
    bends = identify_twin.base_series(ROBOT)
    assert np.sqrt(np.mean(residuals(ROBOT, bends) ** 2)) <= 1.0
