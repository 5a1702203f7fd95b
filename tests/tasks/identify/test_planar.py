"""The planar model's constants from the critical spring and its mode."""

import numpy as np
import pytest
import xarray as xr

from chilopod.errors import AnalysisError
from chilopod.paper.fit_data import critical_mode_data, variant_settings
from chilopod.paper.straight.sections import IDENTIFICATION
from chilopod.robot import load_robot
from chilopod.tasks.identify import planar

ROBOT = load_robot("aoi2022-planar")
DATA = critical_mode_data()


def test_identification_finds_constants_it_was_not_started_from(tiny):
    # Data made with other constants than the preset's: the fit has to find those back, wherever it starts.
    residuals = planar.residuals(ROBOT, DATA)
    assert np.abs(residuals).max() == pytest.approx(1.016, abs=0.01)
    starts = tiny.found[IDENTIFICATION].starts
    assert len(starts) == 3
    for constants in starts:
        off = planar.residuals(planar.with_constants(ROBOT, constants), DATA)
        assert constants == pytest.approx(starts[0], rel=1e-4)
        assert np.abs(off).max() < 1.0
        assert (off**2).sum() < (residuals**2).sum()


def test_the_profile_passes_through_the_best_fit_and_predicts(tiny):
    found = tiny.found[IDENTIFICATION]
    assert isinstance(found.profile, xr.Dataset)
    best = found.best.legs.forward_offset
    cost = np.interp(best, found.profile.forward_offset, found.profile.largest_residual)
    assert cost == pytest.approx(np.abs(found.residuals).max(), abs=0.1)
    assert found.allowed("forward_offset")[0] < best < found.allowed("forward_offset")[1]
    assert np.isfinite(found.profile.uniform).all()
    assert set(variant_settings()) < set(found.profile.data_vars)
    result = found.as_json()
    assert set(result["constants"]) == set(planar.FREE)


def test_residuals_need_the_number_of_modules_of_the_data():
    with pytest.raises(AnalysisError, match="6 modules"):
        planar.residuals(ROBOT.with_value("body.modules", 7), DATA)
