"""The robot's verbs that walk: walk, turn to a target, find how tightly a spring turns, find constants from walks."""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.tasks.course import Driven, Driver, drive, driver
    from chilopod.tasks.identify import identify_planar, identify_twin
    from chilopod.tasks.radius_law import radius_law
    from chilopod.tasks.turn import Turn, best_spring, turn
    from chilopod.tasks.walk import Ends, Walks, ends, foot_creep, planned, walk
else:
    __getattr__, __dir__ = exports(
        __name__,
        {
            "course": ("Driven", "Driver", "drive", "driver"),
            "identify": ("identify_planar", "identify_twin"),
            "radius_law": ("radius_law",),
            "turn": ("Turn", "best_spring", "turn"),
            "walk": ("Ends", "Walks", "ends", "foot_creep", "planned", "walk"),
        },
    )

__all__ = [
    "Driven",
    "Driver",
    "Ends",
    "Turn",
    "Walks",
    "best_spring",
    "drive",
    "driver",
    "ends",
    "foot_creep",
    "identify_planar",
    "identify_twin",
    "planned",
    "radius_law",
    "turn",
    "walk",
]
