import dataclasses
import json

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.studies.fit_data import base_series_data
from chilopod.studies.twin_spread import unlike
from chilopod.tasks.identify import BaseSeries, twin
from chilopod.tasks.identify.twin import TwinIdentification, base_series, known, residuals, search
from chilopod.tasks.identify.twin_constants import FREE, SERVO_TIME, constants_of, with_constants

ROBOT = load_robot("aoi2022")
DATA = base_series_data()


def bends_by_law(onset=34.0, at_21=5 * 0.225 / 0.88):
    """Bends that follow a square root from an onset and have the printed sum at 21."""
    shape = np.array([0.64, 0.36, 0.48, 0.46, 0.16]) / 2.1
    root = np.sqrt(np.maximum(1.0 / np.array(DATA.springs) - 1.0 / onset, 0.0))
    summed = at_21 * root / root[DATA.springs.index(21.0)]
    return np.tile(summed[:, None] * shape, (2, 1, 1))


def test_the_papers_own_law_meets_the_data():
    found = dict(zip(DATA.names, residuals(ROBOT, bends_by_law(), DATA), strict=True))
    # The two printed radii and the printed onset agree with one square root but for their rounding.
    assert abs(found["onset"]) < 1e-6
    assert abs(found["radius at 21"]) < 1e-9
    assert abs(found["radius at 26"]) < 1.0
    assert found["straight at 41"] == found["straight at 75"] == found["curved at 28"] == found["steady"] == 0.0


def test_the_papers_series_says_what_it_is_of():
    assert DATA.springs == (15.0, 17.0, 21.0, 26.0, 28.0, 41.0, 75.0)
    assert DATA.near_onset == (26.0, 28.0)
    straight = ("straight at 41", "straight at 75")
    assert DATA.names == ("radius at 21", "radius at 26", "onset", *straight, "curved at 28", "steady")


def test_a_series_of_ones_own_is_fitted_as_well(tmp_path, monkeypatch):
    own = BaseSeries((12.0, 18.0, 22.0), (50.0,), {18.0: 0.9}, 30.0, (9.0, 1.0 / 30.0), DATA.shape)
    assert own.names == ("radius at 18", "onset", "straight at 50", "curved at 22", "steady")
    kept = []
    for data in (own, DATA, dataclasses.replace(own, law=(9.5, 1.0 / 30.0))):
        monkeypatch.setattr(twin, "base_series", lambda robot, data: np.stack([data.start(data.springs)] * 2))
        fit = twin.evaluate(ROBOT, constants_of(ROBOT), data, tmp_path)
        assert fit.bends.shape == (len(data.springs), 5)
        assert fit.residuals.shape == (len(data.names),)
        kept.append(len(list(tmp_path.iterdir())))
    # What came of one series is not taken for another's.
    assert kept == [1, 2, 3]


def test_every_datum_counts():
    early = dict(zip(DATA.names, residuals(ROBOT, bends_by_law(onset=28.5), DATA), strict=True))
    assert early["onset"] < -2.0
    assert early["curved at 28"] > 0.0
    stiff = bends_by_law()
    stiff[:, DATA.springs.index(41.0)] = 0.1
    assert residuals(ROBOT, stiff, DATA)[DATA.names.index("straight at 41")] > 5.0
    moving = bends_by_law()
    moving[0] *= 0.5
    assert residuals(ROBOT, moving, DATA)[DATA.names.index("steady")] > 0.0
    lost = bends_by_law()
    lost[1, 0] = np.nan
    assert (residuals(ROBOT, lost, DATA) > 10.0).all()


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

    def series(robot, data):
        asked.append(robot)
        return bends_by_law(onset=30.0 + 200.0 * robot.get("legs.forward_offset") / 2.0)

    monkeypatch.setattr(twin, "base_series", series)
    whole = search(ROBOT, DATA, starts=1, generations=2, folder=tmp_path / "a")
    count = len(asked)
    assert count == 20

    class Stop(Exception):
        pass

    def stop(done, words):
        if done > 0.6:
            raise Stop

    with pytest.raises(Stop):
        search(ROBOT, DATA, starts=1, generations=2, folder=tmp_path / "b", progress=stop)
    before = len(asked)
    again = search(ROBOT, DATA, starts=1, generations=2, folder=tmp_path / "b")
    assert len(asked) - before == count - (before - count)
    for one, other in zip(whole, again, strict=True):
        np.testing.assert_array_equal(one.constants, other.constants)
    assert [fit.objective for fit in whole] == sorted(fit.objective for fit in whole)


def test_what_was_found_as_json():
    found = TwinIdentification(ROBOT, DATA, known()).as_json()
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    for path, (low, high) in TwinIdentification(ROBOT, DATA, known()).ranges().items():
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
    bends = base_series(ROBOT, DATA)
    assert np.sqrt(np.mean(residuals(ROBOT, bends, DATA) ** 2)) <= 1.0
