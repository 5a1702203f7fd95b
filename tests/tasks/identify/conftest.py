"""An identification of the planar preset without its profile."""

import numpy as np
import pytest

from chilopod.paper.fit_data import critical_mode_data
from chilopod.robot import load_robot
from chilopod.tasks.identify import Identification, planar_fit

ROBOT = load_robot("aoi2022-planar")
DATA = critical_mode_data()


@pytest.fixture(scope="session")
def found():
    constants, residuals = planar_fit._fit(ROBOT, DATA, np.array([ROBOT.get(path) for path in planar_fit.FREE]))
    ranges = planar_fit.allowed_ranges(ROBOT, DATA, constants)
    rest = {"starts": constants[None], "preset_residuals": residuals, "intervals": ranges, "profile": None}
    rest["spread"] = planar_fit.spread(ROBOT, DATA, constants)
    return Identification(given=ROBOT, data=DATA, constants=constants, residuals=residuals, ranges=ranges, **rest)
