"""A payload is a scalar of the robot file that both engines read."""

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.planar import PlanarModel
from chilopod.twin.model import compiled


def test_payload_is_mass_in_both_engines():
    loaded = load_robot("aoi2022").with_value("body.payload", 1.5)
    heavier = load_robot("aoi2022").with_value("body.mass", 10.0)
    assert (PlanarModel(loaded).scalars == PlanarModel(heavier).scalars).all()
    both = [compiled(robot).model for robot in (loaded, heavier)]
    assert both[0].body_mass.sum() == pytest.approx(10.0, rel=1e-12)
    assert np.array_equal(both[0].body_inertia, both[1].body_inertia)
    assert loaded.weight == heavier.weight
