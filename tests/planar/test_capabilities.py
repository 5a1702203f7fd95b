"""What the planar models can do for the analyses: the assignments are checked by mypy, the rest by running."""

from __future__ import annotations

from chilopod.planar import PlanarModel
from chilopod.planar.along import FollowedModel
from chilopod.robot import load_robot
from chilopod.stability import (
    FlowsMany,
    FlowsStates,
    FlowsWithError,
    KnowsOrbit,
    SpatiallySymmetric,
    SystemLike,
)

MODEL = PlanarModel(load_robot("aoi2022-planar"))
FOLLOWED = FollowedModel(load_robot("aoi2022-planar"))

system: SystemLike = MODEL
knows_orbit: KnowsOrbit = MODEL
spatially_symmetric: SpatiallySymmetric = MODEL
flows_with_error: FlowsWithError = MODEL
flows_states: FlowsStates = MODEL
flows_many: FlowsMany = MODEL


def test_the_models_have_the_capabilities_they_declare() -> None:
    for model in (MODEL, FOLLOWED):
        for capability in (SystemLike, KnowsOrbit, SpatiallySymmetric, FlowsWithError, FlowsStates, FlowsMany):
            assert isinstance(model, capability), capability.__name__
