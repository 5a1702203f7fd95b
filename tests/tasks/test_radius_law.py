"""The radius law of any engine, and what one walk of the twin comes to."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot, planar
from chilopod.analysis.radius_law import radius_laws
from chilopod.tasks import radius_law
from chilopod.tasks.radius_law import end_of_walk
from chilopod.twin import simulate

ROBOT = load_robot("aoi2022")


def test_the_end_of_a_circle_is_its_radius():
    """Angles that do not change give the paper's radius, and module 1's pace is its speed."""
    record = simulate(ROBOT, 0.6, rate=50.0)
    time = np.arange(0.0, 20.0, 0.02)
    made = xr.Dataset(
        {
            "joint_angle": (("time", "robot", "joint"), np.full((time.size, 1, 5), 0.2)),
            "position": (("time", "robot", "axis"), np.stack([0.05 * time, 0.0 * time], -1)[:, None]),
            "status": ("robot", np.array(["walked"], dtype=object)),
        },
        coords={"time": time, "robot": [0], "joint": record.joint, "axis": record.axis},
    )
    end = end_of_walk(made, ROBOT)
    assert float(end.axis_radius) == pytest.approx(5 * 0.225)
    assert float(end.speed) == pytest.approx(0.05)
    assert end.direction.item() == "right"
    assert float(end.moved) == pytest.approx(0.0)


class Trying:
    """The planar model, as one that nobody has a theory of."""

    traits = replace(planar.traits, name="trying", exact=False)

    def __getattr__(self, name):
        return getattr(planar, name)


@pytest.fixture
def trying(monkeypatch):
    monkeypatch.setattr(planar, "trying_engine", Trying(), raising=False)
    return "chilopod.planar:trying_engine"


def test_the_law_of_an_exact_engine_is_that_of_its_branch():
    robot = load_robot("aoi2022-planar")
    law, exact = radius_law(robot), radius_laws(robot).axis
    np.testing.assert_array_equal(law.values, exact.values)
    np.testing.assert_array_equal(law.radii, exact.radii)


def test_the_law_by_trials_is_that_of_the_branch_and_is_kept(trying, tmp_path):
    """Two ways to one law that share nothing but the model: walks of 90 s, and the continued branch."""
    robot = load_robot("aoi2022-planar").set_from_text(["springs.stiffness=18 N*mm/deg"])
    law, exact = radius_law(robot, trying, tmp_path), radius_laws(robot).axis
    assert len(list(tmp_path.glob("trying-*.nc"))) == 9
    for radius in (0.5, 0.7, 0.9):
        assert law.value(radius) == pytest.approx(exact.value(radius), rel=0.05)
    again = radius_law(robot, trying, tmp_path)
    np.testing.assert_array_equal(law.values, again.values)
