"""Robot in three dimensions in MuJoCo: bodies, legs with servos, feet on the floor, scanner."""

from chilopod.twin import gl

# A missing graphics backend must not prevent the import of the physics.
gl.import_mujoco()

from chilopod.twin.creep import Creep, foot_creep  # noqa: E402
from chilopod.twin.cycle_map import CycleMap, walk_cycle  # noqa: E402
from chilopod.twin.edited import Edited  # noqa: E402
from chilopod.twin.model import TwinModel  # noqa: E402
from chilopod.twin.simulate import simulate  # noqa: E402
from chilopod.twin.start import common, initial_states, resume, start, traits  # noqa: E402
from chilopod.twin.walk import TwinWalk  # noqa: E402

__all__ = [
    "Creep",
    "CycleMap",
    "Edited",
    "TwinModel",
    "TwinWalk",
    "common",
    "foot_creep",
    "initial_states",
    "resume",
    "simulate",
    "start",
    "traits",
    "walk_cycle",
]
