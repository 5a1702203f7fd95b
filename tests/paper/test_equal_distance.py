"""Radii at equal distance from each one's own onset: known ratios come out, whatever the onsets."""

import numpy as np
import pytest

from chilopod.paper.measures import change, law_ratio, onset, radius_at, radius_ratio, shares
from chilopod.paper.robot.walks import SPRINGS, VARIANT_SPRINGS
from chilopod.statistics import Estimate
from helpers.made_up_robot import AMPLITUDE, series


@pytest.mark.parametrize("point", [23.0, 25.0, 31.0, 45.0])
@pytest.mark.parametrize("wider", [0.8, 1.0, 1.25])
def test_a_known_ratio(point, wider):
    base = series(SPRINGS, 34.0, scatter=0.0)
    found = radius_ratio(base, series(VARIANT_SPRINGS, point, AMPLITUDE / wider, scatter=0.0))
    assert found.distance.value == pytest.approx(wider, rel=2e-3)
    law = law_ratio(found.compared, 34.0, point)
    assert found.springs.value == pytest.approx(wider * law, rel=5e-3)


def test_what_the_printed_onsets_alone_make_of_it():
    """A quarter softer, half as wide again: at equal springs "unchanged" cannot mean equal radii."""
    at_21 = np.sqrt((1 / 21 - 1 / 34) / (1 / 21 - 1 / 23))
    assert law_ratio((21.0, 28.0), 34.0, 23.0) == pytest.approx(at_21)  # 28 is beyond that onset
    assert law_ratio((15.0, 17.0, 21.0), 34.0, 34.0) == 1.0
    assert np.isnan(law_ratio((28.0,), 34.0, 23.0))


@pytest.mark.parametrize("onset", [23.0, 25.0, 31.0])
def test_saturation_does_not_feign_another_radius(onset):
    """Bends that grow by a tenth less than the square root over the springs, in robots that are alike else."""
    base = series(SPRINGS, 34.0, saturation=0.1, scatter=0.0)
    variant = series(VARIANT_SPRINGS, onset, saturation=0.1, scatter=0.0)
    assert radius_ratio(base, variant).distance.value == pytest.approx(1.0, abs=0.03)
    wider = series(VARIANT_SPRINGS, onset, AMPLITUDE / 1.25, saturation=0.1, scatter=0.0)
    assert radius_ratio(base, wider).distance.value == pytest.approx(1.25, abs=0.04)


def test_the_standard_error_is_that_of_repeated_series():
    """Over many sets of trials the ratio scatters as its error says."""
    rng = np.random.default_rng(0)

    def noisy(springs, onset):
        data = series(springs, onset, scatter=0.0, repeats=5)
        factor = 1.0 + 0.05 * rng.standard_normal(data.bend.shape)
        return data.assign(bend=data.bend * factor, axis_radius=data.axis_radius / factor)

    found = [radius_ratio(noisy(SPRINGS, 34.0), noisy(VARIANT_SPRINGS, 25.0)) for _ in range(30)]
    for name in ("distance", "springs"):
        values = np.array([getattr(each, name).value for each in found])
        errors = np.array([getattr(each, name).error for each in found])
        assert errors.mean() == pytest.approx(values.std(ddof=1), rel=0.35)


def test_series_that_cannot_be_compared():
    base = series(SPRINGS, 34.0)
    straight = radius_ratio(base, series((41.0, 75.0), 34.0))
    assert np.isnan(straight.distance.value)
    assert np.isnan(straight.springs.value)
    assert straight.compared == ()
    single = radius_ratio(base, series(VARIANT_SPRINGS, 25.0, repeats=6).isel(repeat=[0]))
    assert single.distance.value == pytest.approx(1.0, abs=0.1)
    assert np.isnan(single.distance.error)


def test_words():
    assert change(Estimate(1.583)) == "+58 %"
    assert change(Estimate(0.999, 0.02)) == "+0 ± 2 %"
    assert change(Estimate()) == "not determined"


def test_walks_that_have_not_settled_are_no_measure_of_the_radius():
    base = series(SPRINGS, 34.0, scatter=0.0)
    growing = base.copy(deep=True)
    growing["axis_radius"][:, 0] *= 3.0
    growing["mean_angle"][:, 0] /= 3.0
    growing["settled"][:, 0] = False
    assert radius_at(growing, 21.0).value == pytest.approx(radius_at(base, 21.0).value)
    assert onset(growing).critical == pytest.approx(onset(base).critical)
    assert radius_at(growing, 21.0, settled=False).value > 1.1 * radius_at(base, 21.0).value
    assert shares(growing).curved.sel(spring=21.0) == 1.0
