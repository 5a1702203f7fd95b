"""The whole robot in three dimensions, in MuJoCo: bodies, legs with servos, feet on the floor, scanner."""

from chilopod.twin.model import TwinModel
from chilopod.twin.simulate import initial_states, simulate

__all__ = ["TwinModel", "initial_states", "simulate"]
