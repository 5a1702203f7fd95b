import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot
from chilopod.engine import engine_named
from chilopod.paper.printed import base_series_data
from chilopod.paper.robot import structures
from chilopod.paper.robot.figures import trust
from chilopod.paper.robot.spread import LOWER
from chilopod.paper.robot.structures import STRUCTURES
from chilopod.tasks.identify.data import FITTED
from chilopod.tasks.identify.twin_series import Series

ROBOT = load_robot("aoi2022")
STRIDE = "stride 1.8 cm"


def walked(robot, engine):
    walk = engine_named(engine).start(robot)
    walk.advance(1.0)
    assert walk.status[0].label == "walked"
    return walk.observe().joint_angles


@pytest.fixture(scope="module")
def usual():
    return walked(ROBOT, "twin")


@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda each: each.name)
def test_every_structure_walks_and_walks_differently(structure, usual):
    moved = np.abs(walked(ROBOT.set_from_text(structure.overrides), structure.engine) - usual).max()
    assert (moved == 0.0) == (structure.name in ("as it is", "slow scanner"))


def test_constants_are_moved_until_the_series_is_met_again(monkeypatch):
    rng = np.random.default_rng(2)
    law = rng.normal(0.0, 10.0, (4, len(FITTED.paths)))
    start = FITTED.parts_of(FITTED.of(ROBOT))

    def off(robot, data, engine="twin", duration=60.0):
        moved = FITTED.parts_of(FITTED.of(robot)) - start
        return law @ moved + 2.0 * (law @ moved) ** 2 / 30.0 + (4.0 if engine == "another" else 0.0)

    monkeypatch.setattr(structures, "_off", off)
    measured = structures._law(ROBOT, None, lambda done, words: None)
    np.testing.assert_allclose(measured, law, rtol=1e-6)
    given, fitted, robot = structures._fitted(ROBOT, None, measured, "another", 5, 60.0)
    assert given == pytest.approx(4.0)
    assert fitted < 1.0
    assert np.abs(FITTED.parts_of(FITTED.of(robot)) - start).max() < 0.4  # by the shortest way
    assert structures._fitted(ROBOT, None, measured, "twin", 5, 60.0)[0] == 0.0


def test_a_structure_that_falls_is_far_off(monkeypatch):
    data = base_series_data()
    bends = np.full((len(data.springs), 5), 0.225 / 1.1)
    bends[1] = np.nan
    monkeypatch.setattr(structures, "base_series", lambda *_, **__: Series(bends, bends, bends[:, 0]))
    np.testing.assert_array_equal(structures._off(ROBOT, data), np.full(4, 30.0))


def made_up(predicted):
    names = ["k2-5 = 28 N*mm/deg", STRIDE, f"{STRIDE}{LOWER}", "all springs alike"]
    count = len(predicted)
    return xr.Dataset(
        {
            "predicted": (("structure", "prediction"), np.array(predicted)),
            "paper": ("prediction", [23.0, 25.0, 25.0, 18.0]),
            "misfit": (("structure", "fit"), np.tile([3.0, 0.5], (count, 1))),
            "about": ("structure", np.array([f"the {i}th" for i in range(count)], dtype=object)),
            "criteria": (("structure", "strategy", "criterion"), np.ones((count, 2, 3))),
        },
        coords={
            "structure": [f"s{i}" for i in range(count)],
            "prediction": names,
            "fit": ["given", "fitted"],
            "strategy": ["pitchfork", "hopf"],
        },
    )


def test_of_two_readings_the_nearer_counts():
    found = structures._with_chi_squared(
        made_up([[23.0, 25.0, 30.0, 18.0], [23.0, 30.0, 26.25, 18.0], [23.0 * 1.1, 25.0, 25.0, 18.0 * 0.9]])
    )
    np.testing.assert_allclose(found.chi_squared, [0.0, 1.0, 8.0])


def test_the_panel_says_who_is_nearer():
    found = structures._with_chi_squared(made_up([[30.0, 25.0, 25.0, 18.0], [24.0, 25.0, 25.0, 18.0]]))
    shown = trust.structures(found)
    assert "less have s1" in " ".join(shown.text)
    assert "below those of springs all alike with none of those that meet it" in " ".join(shown.text)
    shown.draw(False)
    shown.draw(True)
