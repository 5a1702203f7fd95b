"""Curves in the plane of two parameters on which the straight walk changes."""

from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure

from chilopod.analysis import bifurcations, transition_curve
from chilopod.analysis.parameters import ALL, K1, stiffness
from chilopod.analysis.transition_curves import family2
from chilopod.errors import AnalysisError, ParameterError
from chilopod.robot import load_robot
from chilopod.stability import CodimensionTwo, Kind

ROBOT = load_robot("aoi2022-planar")
OFFSET = "legs.forward_offset"


def test_pitchfork_turns_along_its_curve():
    found = transition_curve(
        ROBOT, (K1, OFFSET), ((stiffness(11.5), stiffness(12.5)), (0.045, 0.05)), Kind.PITCHFORK, second=0.048, points=8
    )
    (point,) = found.curve.special
    assert point.kind is CodimensionTwo.DEGENERATE_PITCHFORK
    # Where the coefficients of points located one by one pass through zero.
    offsets = point.values[1] + np.array([-1e-4, 1e-4])
    beside = [
        bifurcations(ROBOT.with_value(OFFSET, offset), K1, (stiffness(11.8), stiffness(12.1)))[0] for offset in offsets
    ]
    low, high = (each.point.coefficient for each in beside)
    assert low > 0.0 > high
    assert point.values[1] == pytest.approx(offsets[0] + 2e-4 * low / (low - high), abs=1e-7)
    assert point.error_bound[1] < 1e-8
    np.testing.assert_allclose(point.values[0], np.mean([each.point.value for each in beside]), rtol=1e-6)
    for each, values in zip(found.curve.points, found.values, strict=True):
        assert values[1] == pytest.approx(found.shown(each.values)[1])
    axes = found.plot(Figure().add_subplot())
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("springs.stiffness[0] (N·mm/deg)", "legs.forward_offset (m)")
    line, mark = (each.get_xydata() for each in axes.lines)
    np.testing.assert_array_equal(line, found.values)
    np.testing.assert_array_equal(mark, [found.shown(point.values)])
    shown = ElementTree.fromstring(found._repr_html_())
    cells = [cell.text for row in shown.iter("tr") for cell in row]
    assert cells[:4] == ["on it", "springs.stiffness[0] (N·mm/deg)", "legs.forward_offset (m)", "degenerate pitchfork"]
    assert float(cells[5].split(" ± ")[0]) == pytest.approx(point.values[1])


def test_oscillation_of_all_springs_together():
    found = transition_curve(
        ROBOT,
        (ALL, OFFSET),
        ((stiffness(4.0), stiffness(9.0)), (0.04, 0.05)),
        Kind.NEIMARK_SACKER,
        second=0.048,
        points=3,
    )
    for point in found.curve.points[::3]:
        (alone,) = bifurcations(
            ROBOT.with_value(OFFSET, float(point.values[1])),
            ALL,
            (0.97 * float(point.values[0]), 1.03 * float(point.values[0])),
            normal_form=False,
        )
        assert point.values[0] == pytest.approx(alone.point.value, abs=point.error_bound[0] + alone.point.error_bound)
        assert point.frequency == pytest.approx(alone.point.frequency, rel=1e-7)


def test_what_is_no_plane_of_parameters():
    with pytest.raises(ParameterError, match="must be two parameters"):
        family2(ROBOT, (K1, K1))
    with pytest.raises(ParameterError, match="whole number"):
        family2(ROBOT, (K1, "body.modules"))
    with pytest.raises(AnalysisError, match="no fold"):
        transition_curve(
            ROBOT, (K1, OFFSET), ((stiffness(11.5), stiffness(12.5)), (0.04, 0.05)), Kind.FOLD, second=0.048
        )
