import dataclasses
import json

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.paper.fit_data import base_series_data
from chilopod.tasks.identify import BaseSeries, twin, twin_series
from chilopod.tasks.identify.twin import Fit, TwinIdentification, known, refined, search, unlike
from chilopod.tasks.identify.twin_constants import FREE, constants_of, parts_of, values_at, with_constants
from chilopod.tasks.identify.twin_series import Series, base_series, residuals

ROBOT = load_robot("aoi2022")
DATA = base_series_data()


def series_by_law(onset=34.0, at_21=5 * 0.225 / 0.88, speed=1.294 / 23.0):
    """Bends that follow a square root from an onset and have the printed sum at 21, at the robot's speed."""
    shape = np.array([0.64, 0.36, 0.48, 0.46, 0.16]) / 2.1
    root = np.sqrt(np.maximum(1.0 / np.array(DATA.springs) - 1.0 / onset, 0.0))
    summed = at_21 * root / root[DATA.springs.index(21.0)]
    bends = summed[:, None] * shape
    return Series(bends, bends.copy(), np.full(len(bends), speed))


def residual(name, found):
    return dict(zip(DATA.names, residuals(ROBOT, found, DATA), strict=True))[name]


def test_the_papers_own_law_meets_the_data():
    found = dict(zip(DATA.names, residuals(ROBOT, series_by_law(), DATA), strict=True))
    # The two printed radii and the printed onset agree with one square root but for their rounding.
    assert abs(found["onset"]) < 1e-6
    assert abs(found["radius at 21"]) < 1e-9
    assert abs(found["radius at 26"]) < 1.0
    assert abs(found["speed at 21"]) < 0.01
    assert found["straight at 41"] == found["straight at 75"] == found["curved at 28"] == found["steady"] == 0.0


def test_the_papers_series_says_what_it_is_of():
    assert DATA.springs == (15.0, 17.0, 21.0, 26.0, 28.0, 41.0, 75.0)
    straight = ("straight at 41", "straight at 75")
    assert DATA.names == ("radius at 21", "radius at 26", "speed at 21", "onset", *straight, "curved at 28", "steady")


def test_the_speed_follows_from_the_printed_time_distance_and_angle():
    # A circle through the robot and a target 1.3 m away, 45 deg to the side, which it leaves along its heading: a
    # quarter of a circle. 0.15 m before its end it has arrived, after 23 s.
    radius = 1.3 / np.sqrt(2.0)
    assert DATA.speeds == {21.0: pytest.approx((0.5 * np.pi * radius - 0.15) / 23.0)}
    assert round(DATA.speeds[21.0], 3) == 0.056


def made_up(data):
    start = data.start(data.springs)
    return Series(start, start, np.full(len(start), 0.05))


def test_a_series_of_ones_own_is_fitted_as_well(tmp_path, monkeypatch):
    own = BaseSeries((12.0, 18.0, 22.0), (50.0,), {18.0: 0.9}, 30.0, (9.0, 1.0 / 30.0), DATA.shape)
    assert own.names == ("radius at 18", "onset", "straight at 50", "curved at 22", "steady")
    kept = []
    for data in (own, DATA, dataclasses.replace(own, law=(9.5, 1.0 / 30.0))):
        monkeypatch.setattr(twin, "base_series", lambda robot, data: made_up(data))
        fit = twin.evaluate(ROBOT, constants_of(ROBOT), data, tmp_path)
        assert fit.bends.shape == (len(data.springs), 5)
        assert fit.residuals.shape == (len(data.names),)
        kept.append(len(list(tmp_path.iterdir())))
    # What came of one series is not taken for another's.
    assert kept == [1, 2, 3]


def test_every_datum_counts():
    assert residual("onset", series_by_law(onset=28.5)) < -2.0
    assert residual("curved at 28", series_by_law(onset=28.5)) > 0.0
    assert residual("speed at 21", series_by_law(speed=0.084)) == pytest.approx(
        (0.084 * 23.0 / 1.294 - 1.0) / 0.05, abs=0.02
    )
    stiff = series_by_law()
    stiff.bends[DATA.springs.index(41.0)] = 0.1
    assert residual("straight at 41", stiff) > 5.0
    moving = series_by_law()
    moving.before[:] *= 0.5
    assert residual("steady", moving) > 0.0
    lost = series_by_law()
    lost.bends[0] = np.nan
    assert (residuals(ROBOT, lost, DATA) > 10.0).all()


def test_constants_go_in_and_come_out():
    parts = np.linspace(0.1, 0.9, len(FREE))
    values = values_at(parts)
    robot = with_constants(ROBOT, values)
    np.testing.assert_allclose(constants_of(robot), values, rtol=1e-12)
    np.testing.assert_allclose(parts_of(values), parts, rtol=1e-12)
    # The servos' damping is searched as a time: its stiffness over, it lies within 0.02 to 0.15 s.
    time = robot.get("twin.servo_damping") / robot.get("twin.servo_stiffness")
    assert time == pytest.approx(0.02 * 7.5 ** parts[-1])
    preset = parts_of(constants_of(ROBOT))
    assert ((preset > 0.0) & (preset < 1.0)).all()


def test_walks_that_are_far_off_are_left_early(monkeypatch):
    ends = []
    whole = twin_series._series
    monkeypatch.setattr(twin_series, "_series", lambda walk, robot: (ends.append(walk.time), whole(walk, robot))[1])
    monkeypatch.setattr(twin_series, "_SOONER", 18.0)
    base_series(ROBOT.with_value("twin.sliding_friction", 0.3), DATA, duration=30.0)
    assert ends == [18.0]
    base_series(ROBOT.with_value("twin.sliding_friction", 0.3), DATA, springs=(15.0,), duration=30.0)
    assert ends == [18.0, 30.0]


def test_a_search_that_was_stopped_goes_on_where_it_was(tmp_path, monkeypatch):
    asked = []

    def series(robot, data):
        asked.append(robot)
        return series_by_law(onset=30.0 + 200.0 * robot.get("legs.forward_offset") / 2.0)

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


def test_near_evaluations_are_refined_to_where_the_data_are_met(monkeypatch):
    rng = np.random.default_rng(3)
    slopes = np.zeros((len(DATA.names), len(FREE)))
    slopes[:4] = rng.normal(0.0, 8.0, (4, len(FREE)))
    middle = np.full(len(FREE), 0.5)

    def made_up_fit(robot, constants, data, folder=None):
        place = parts_of(constants)
        off = slopes @ (place - middle)
        return Fit(constants, np.zeros((7, 5)), np.zeros(7), off + 0.5 * np.sign(off) * off**2 / 10.0)

    monkeypatch.setattr(twin, "evaluate", made_up_fit)
    fits = [made_up_fit(ROBOT, values_at(middle + rng.normal(0.0, 0.12, len(FREE))), DATA) for _ in range(200)]
    fits.sort(key=lambda fit: fit.objective)
    found = refined(ROBOT, DATA, fits)
    good = [fit for fit in found if fit.misfit < 1.0]
    assert len(good) >= 10
    # They are not all the same one: the data leave directions open.
    places = np.array([parts_of(fit.constants) for fit in good])
    assert places.std(axis=0).max() > 0.05
    assert refined(ROBOT, DATA, fits[:10]) == []


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
    assert np.sqrt(np.mean(residuals(ROBOT, base_series(ROBOT, DATA), DATA) ** 2)) <= 1.0


def test_a_fit_is_good_if_it_meets_every_datum_and_without_one_none_is_found():
    fits = known()
    found = TwinIdentification(ROBOT, DATA, fits)
    assert 0 < len(found.good) < sum(fit.misfit <= 1.0 for fit in fits)
    assert all((np.abs(fit.residuals) <= 1.0).all() for fit in found.good)
    worse = [fit for fit in fits if fit.largest > 1.0]
    none = TwinIdentification(ROBOT, DATA, worse)
    assert none.ranges() == {}
    assert none.as_json()["constants"]["legs.half_width"]["good_fits_text"] == "none found"
    assert "no evaluation of 33 meets every datum; the nearest misses the" in none.words()
    assert f"by {min(fit.largest for fit in worse):.2f} tolerances" in none.words()
