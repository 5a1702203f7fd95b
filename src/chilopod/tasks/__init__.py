"""Tasks with walks: walk, turn to a target, measure a radius law, walk a course, identify constants."""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.tasks.course import Driven, Driver, drive, driver
    from chilopod.tasks.identify import Identification, TwinIdentification, identify_planar, identify_twin
    from chilopod.tasks.radius_law import radius_law
    from chilopod.tasks.sizing import size
    from chilopod.tasks.sizing.result import Sizing
    from chilopod.tasks.turn import Turn, turn
    from chilopod.tasks.walk import Ends, RunOptions, Walks, ends, walk
else:
    __getattr__, __dir__ = exports(
        __name__,
        {
            "course": ("Driven", "Driver", "drive", "driver"),
            "identify": ("Identification", "TwinIdentification", "identify_planar", "identify_twin"),
            "radius_law": ("radius_law",),
            "sizing": ("size",),
            "sizing.result": ("Sizing",),
            "turn": ("Turn", "turn"),
            "walk": ("Ends", "RunOptions", "Walks", "ends", "walk"),
        },
    )

__all__ = [
    "Driven",
    "Driver",
    "Ends",
    "Identification",
    "RunOptions",
    "Sizing",
    "Turn",
    "TwinIdentification",
    "Walks",
    "drive",
    "driver",
    "ends",
    "identify_planar",
    "identify_twin",
    "radius_law",
    "size",
    "turn",
    "walk",
]
