"""What the planar models can do for the analyses: the assignment is checked by mypy, the rest by running."""

from __future__ import annotations

from chilopod.planar import PlanarModel
from chilopod.planar.along import FollowedModel
from chilopod.robot import load_robot
from chilopod.stability import SystemLike

MODEL = PlanarModel(load_robot("aoi2022-planar"))
FOLLOWED = FollowedModel(load_robot("aoi2022-planar"))

system: SystemLike = MODEL


def test_the_models_have_the_capabilities_they_declare() -> None:
    for model in (MODEL, FOLLOWED):
        for member in ("orbit", "spatial_symmetry", "flow_with_error", "flow_states", "flow_many", "can_flow_with"):
            assert hasattr(model, member), member
