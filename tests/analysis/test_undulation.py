"""The settled undulation of uniform springs against the normal form at the Neimark-Sacker point."""

import numpy as np
import pytest

from chilopod.analysis.undulation import undulating_walks
from chilopod.errors import ParameterError
from chilopod.robot import load_robot
from chilopod.show import write_undulation

ROBOT = load_robot("aoi2022-planar")


@pytest.fixture(scope="module")
def data():
    return undulating_walks(ROBOT, (0.02, 0.04))


def test_near_the_point_the_normal_form_is_right(data):
    off = np.abs(data.amplitude / data.predicted_amplitude - 1.0).values
    assert off[0] < 0.01
    first = data.attrs["frequency_rad_s"]
    shift = (data.frequency - first).values
    missed = np.abs((data.predicted_frequency - first).values / shift - 1.0)
    assert (shift < 0).all()
    assert missed[0] < 0.06
    # Both are the first term of a series in the distance: half as far, half as wrong.
    assert off[1:] / off[:-1] == pytest.approx(2.0, rel=0.1)
    assert missed[1:] / missed[:-1] == pytest.approx(2.0, rel=0.1)


def test_amplitude_grows_as_the_root_of_the_distance(data):
    assert (data.amplitude / np.sqrt(data.distance)).values == pytest.approx(1.74, rel=0.02)


def test_the_joints_swing_as_in_the_mode(data):
    shape = data.swing / data.amplitude
    assert shape.isel(distance=0).values == pytest.approx(data.component.values, abs=0.01)


def test_what_settled_does_not_depend_on_how_long_it_took(data):
    alone = undulating_walks(ROBOT, (0.04,))
    assert float(alone.amplitude[0]) == pytest.approx(float(data.amplitude[1]), rel=1e-4)
    assert float(alone.frequency[0]) == pytest.approx(float(data.frequency[1]), rel=1e-5)


def test_drawn(data, tmp_path):
    files = write_undulation(data, tmp_path)
    assert sorted(file.suffix for file in files) == [".csv", ".nc", ".png", ".svg"]
    assert all(file.stat().st_size > 300 for file in files)


def test_distances_must_lie_below_the_point():
    with pytest.raises(ParameterError, match="distances"):
        undulating_walks(ROBOT, (0.01, 0.0))
