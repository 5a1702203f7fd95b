"""The planar model's constants from the critical spring and its mode."""

import numpy as np
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


def test_a_robot_without_a_pitchfork_is_refused(monkeypatch):
    # Of such a robot every search ends where it began.
    monkeypatch.setattr(planar, "residuals", lambda robot, data: np.full(6, planar._NO_PITCHFORK))
    with pytest.raises(AnalysisError, match="has no pitchfork with any constants"):
        planar.identify_planar(ROBOT, DATA)
