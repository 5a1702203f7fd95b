"""An identification of the planar preset without its profile."""

import numpy as np
import pytest

from chilopod.paper.printed import critical_mode_data
from chilopod.robot import load_robot
from chilopod.tasks.identify import Identification, planar_fit


@pytest.fixture(scope="session")
def found():
    robot, data = load_robot("aoi2022-planar"), critical_mode_data()
    constants, residuals = planar_fit._fit(robot, data, np.array([robot.get(path) for path in planar_fit.FREE]))
    *ranges, group = planar_fit.allowed_ranges(robot, data, constants, goals=4)[0]
    ranges, rest = np.array(ranges), {"starts": constants[None], "preset_residuals": residuals, "profile": None}
    rest |= {"intervals": ranges, "group": group}
    rest["cut"] = np.zeros((2, 3, 2), dtype=bool)
    rest["spread"] = planar_fit.spread(robot, data, constants)
    return Identification(given=robot, data=data, constants=constants, residuals=residuals, ranges=ranges, **rest)
