"""The studies against the paper's numbers and against what is known of them."""

import numpy as np
import pytest

from chilopod.analysis.map_axes import with_modules
from chilopod.paper.section import Context, Size
from chilopod.paper.straight import study as floquet

QUICK = Context(size=Size.QUICK)
ROBOT = QUICK.robot


def test_each_curve_of_the_sweep_is_one_curve():
    data = floquet.exponent_sweep(QUICK)
    # The sum over all curves does not care how they are told apart; each curve has to be smooth besides.
    real = data["real"].values
    steps = np.abs(np.diff(real, axis=0)) / (1.0 + np.abs(real[:-1]))
    assert steps.max() < 0.5
    assert data.follows_critical.values.sum() == 1
    critical = data["real"].values[:, data.follows_critical.values][:, 0]
    stable = data.k1.values > 11.9914297
    assert (critical[stable] < 0).all()
    assert (critical[~stable] > 0).all()
    assert np.allclose(data["imaginary"].values[:, data.follows_critical.values][~stable], 0.0)


def test_variants_go_the_way_the_paper_says():
    data = floquet.variants(QUICK)
    base, softer, slower, phase = data.critical_k1.values
    assert base == pytest.approx(11.991, abs=0.001)
    assert (softer, slower) < (base, base)
    assert (softer, slower, phase) == pytest.approx((8.919, 10.786, 11.344), abs=0.001)
    assert data.robot_printed.values.tolist() == pytest.approx([34, 23, 25, 31])


def test_more_modules_of_the_same_size_change_little():
    data = floquet.module_counts(QUICK).sel(modules=range(6, 11))
    assert data.critical_k1.values == pytest.approx([11.99, 11.99, 11.91, 12.18, 12.40], abs=0.01)
    longer = with_modules(ROBOT, 9)
    assert longer.module_length == pytest.approx(ROBOT.module_length, rel=1e-15)
    assert longer.module_mass == pytest.approx(ROBOT.module_mass, rel=1e-15)
