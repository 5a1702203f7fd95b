"""The planar model's constants from the critical spring and its mode."""

import pytest

from chilopod.errors import AnalysisError
from chilopod.paper.fit_data import critical_mode_data
from chilopod.robot import load_robot
from chilopod.tasks.identify import planar

ROBOT = load_robot("aoi2022-planar")
DATA = critical_mode_data()


def test_residuals_need_the_number_of_modules_of_the_data():
    with pytest.raises(AnalysisError, match="6 modules"):
        planar.residuals(ROBOT.with_value("body.modules", 7), DATA)
