"""The paper's planar model: compiled equations of motion, linearisation, flow and its derivative."""

from chilopod.planar.drift import Drift
from chilopod.planar.energy import Powers, energy, powers
from chilopod.planar.model import PlanarModel
from chilopod.planar.simulate import initial_states, simulate

__all__ = ["Drift", "PlanarModel", "Powers", "energy", "initial_states", "powers", "simulate"]
