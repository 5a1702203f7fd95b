"""The paper's planar model: compiled equations of motion, linearisation, flow and its derivative."""

from chilopod.planar.drift import Drift
from chilopod.planar.energy import Powers, energy, powers
from chilopod.planar.model import PlanarModel

__all__ = ["Drift", "PlanarModel", "Powers", "energy", "powers"]
