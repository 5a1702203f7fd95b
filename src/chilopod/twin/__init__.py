"""Robot in three dimensions in MuJoCo: bodies, legs with servos, feet on the floor, scanner."""

from typing import TYPE_CHECKING

from chilopod.lazy import exports
from chilopod.twin import gl

# A missing graphics backend must not prevent the import of the physics.
gl.import_mujoco()

from chilopod.twin.creep import Creep, foot_creep  # noqa: E402
from chilopod.twin.cycle_map import CycleMap  # noqa: E402
from chilopod.twin.edited import Edited  # noqa: E402
from chilopod.twin.model import TwinModel  # noqa: E402
from chilopod.twin.simulate import simulate  # noqa: E402
from chilopod.twin.start import common, initial_states, resume, start, traits  # noqa: E402
from chilopod.twin.walk import TwinWalk  # noqa: E402

if TYPE_CHECKING:
    from chilopod.twin.modes import CycleMultipliers
    from chilopod.twin.multipliers import cycle_multipliers, walk_multipliers
    from chilopod.twin.onset import bend_onset
else:  # walks need nothing of chilopod.stability
    __getattr__, __dir__ = exports(
        __name__,
        {
            "modes": ("CycleMultipliers",),
            "multipliers": ("cycle_multipliers", "walk_multipliers"),
            "onset": ("bend_onset",),
        },
    )

__all__ = [
    "Creep",
    "CycleMap",
    "CycleMultipliers",
    "Edited",
    "TwinModel",
    "TwinWalk",
    "bend_onset",
    "common",
    "cycle_multipliers",
    "foot_creep",
    "initial_states",
    "resume",
    "simulate",
    "start",
    "traits",
    "walk_multipliers",
]
