"""The paper's planar model: compiled equations of motion, linearisation, flow and its derivative; an engine."""

from chilopod.planar.drift import Drift
from chilopod.planar.energy import Powers, energy, powers
from chilopod.planar.model import PlanarModel
from chilopod.planar.simulate import simulate
from chilopod.planar.walk import PlanarWalk, common, initial_states, resume, start, traits

__all__ = [
    "Drift",
    "PlanarModel",
    "PlanarWalk",
    "Powers",
    "common",
    "energy",
    "initial_states",
    "powers",
    "resume",
    "simulate",
    "start",
    "traits",
]
