"""The paper's planar model: compiled equations of motion, linearisation, flow and its derivative."""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.planar.drift import Drift
    from chilopod.planar.energy import Powers, energy, powers
    from chilopod.planar.model import PlanarModel
    from chilopod.planar.simulate import initial_states, simulate
else:
    # Analysis needs the model but no records of walks, and so no xarray.
    __getattr__, __dir__ = exports(
        __name__,
        {
            "drift": ("Drift",),
            "energy": ("Powers", "energy", "powers"),
            "model": ("PlanarModel",),
            "simulate": ("initial_states", "simulate"),
        },
    )

__all__ = ["Drift", "PlanarModel", "Powers", "energy", "initial_states", "powers", "simulate"]
