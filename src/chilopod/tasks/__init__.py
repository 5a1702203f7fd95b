"""Tasks with walks: walk, turn to a target, measure a radius law, walk a course, identify constants."""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.tasks.course import Driven as Driven
    from chilopod.tasks.course import Driver as Driver
    from chilopod.tasks.course import drive as drive
    from chilopod.tasks.course import driver as driver
    from chilopod.tasks.identify import Identification as Identification
    from chilopod.tasks.identify import TwinIdentification as TwinIdentification
    from chilopod.tasks.identify import identify_planar as identify_planar
    from chilopod.tasks.identify import identify_twin as identify_twin
    from chilopod.tasks.radius_law import radius_law as radius_law
    from chilopod.tasks.sizing import Sizing as Sizing
    from chilopod.tasks.sizing import size as size
    from chilopod.tasks.turn import Turn as Turn
    from chilopod.tasks.turn import turn as turn
    from chilopod.tasks.walk import Ends as Ends
    from chilopod.tasks.walk import RunOptions as RunOptions
    from chilopod.tasks.walk import Walks as Walks
    from chilopod.tasks.walk import ends as ends
    from chilopod.tasks.walk import walk as walk
else:
    __getattr__, __dir__ = exports(
        __name__,
        {
            "course": ("Driven", "Driver", "drive", "driver"),
            "identify": ("Identification", "TwinIdentification", "identify_planar", "identify_twin"),
            "radius_law": ("radius_law",),
            "sizing": ("Sizing", "size"),
            "turn": ("Turn", "turn"),
            "walk": ("Ends", "RunOptions", "Walks", "ends", "walk"),
        },
    )
