"""What one walk of the twin comes to."""

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot
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
