"""The paper's planar model as an engine: compiled equations of motion, linearisation, flow and its derivative."""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.planar.drift import Drift
    from chilopod.planar.energy import Powers, energy, powers
    from chilopod.planar.model import PlanarModel
    from chilopod.planar.simulate import simulate
    from chilopod.planar.walk import PlanarWalk, common, initial_states, resume, start, traits
else:
    # Analysis needs the model but no records of walks, and so no xarray.
    __getattr__, __dir__ = exports(
        __name__,
        {
            "drift": ("Drift",),
            "energy": ("Powers", "energy", "powers"),
            "model": ("PlanarModel",),
            "simulate": ("simulate",),
            "walk": ("PlanarWalk", "common", "initial_states", "resume", "start", "traits"),
        },
    )

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
