"""The square-root fit to trials: a known point, honest error bars, and what determines no point."""

import numpy as np
import pytest

from chilopod.analysis import square_root_fit
from chilopod.errors import AnalysisError, ParameterError

SPRINGS = np.repeat([7.0, 8.0, 9.0, 10.0, 11.0, 11.5], 10)
POINT = 12.0


def test_the_fit_finds_a_known_point():
    inverse = 1.0 / SPRINGS
    fit = square_root_fit(inverse, -5.0 * np.sqrt(inverse - 1.0 / POINT))
    assert fit.critical == pytest.approx(POINT, rel=1e-6)
    assert fit.amplitude == pytest.approx(5.0, rel=1e-6)
    assert fit.angle([1.0 / 13.0, 1.0 / 10.0]) == pytest.approx([0.0, 5.0 * np.sqrt(1 / 60)], rel=1e-6)
    # Straight trials on the stiff side change nothing, and one trial at each spring shows no scatter.
    straight = square_root_fit(np.r_[inverse, 1 / 15, 1 / 41], np.r_[5.0 * np.sqrt(inverse - 1.0 / POINT), 0.0, 0.0])
    assert straight.critical == pytest.approx(POINT, rel=1e-6)
    assert np.isnan(square_root_fit(inverse[::10], 5.0 * np.sqrt(inverse[::10] - 1.0 / POINT)).estimate.error)


@pytest.mark.parametrize("noise", ["angle", "point"])
def test_error_bars_are_calibrated(noise):
    """Over many made-up sets of trials the fit is off by as much as its errors say."""
    rng, inverse = np.random.default_rng(1), 1.0 / SPRINGS
    fits = []
    for _ in range(120):
        moved = rng.normal(0.0, 3e-4, inverse.size) if noise == "point" else 0.0
        angle = 5.0 * np.sqrt(inverse - 1.0 / POINT - moved)
        fits.append(square_root_fit(inverse, angle + (noise == "angle") * 0.03 * rng.standard_normal(inverse.size)))
    off = np.array([fit.critical for fit in fits]) - POINT
    assert abs(off.mean()) < 4.0 * off.std() / np.sqrt(off.size)
    assert (off / [fit.estimate.error for fit in fits]).std() == pytest.approx(1.0, abs=0.25)
    if noise == "angle":  # what least squares assumes
        assert (off / [fit.error for fit in fits]).std() == pytest.approx(1.0, abs=0.25)


def test_trials_that_determine_no_point_are_refused():
    with pytest.raises(AnalysisError, match="two springs"):
        square_root_fit([0.1, 0.1, 0.1], [1.0, 1.1, 0.9])
    with pytest.raises(AnalysisError, match="must fall to zero as a square root"):
        square_root_fit([0.10, 0.12, 0.14], [1.0, 1.0, 1.0])
    with pytest.raises(ParameterError, match="one value for each"):
        square_root_fit([0.10, 0.12], [1.0])
    with pytest.raises(ParameterError, match="finite"):
        square_root_fit([0.10, 0.12, 0.14], [1.0, np.nan, 1.0])
