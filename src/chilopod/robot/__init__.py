"""Description of a robot for every engine: validated, immutable, read from TOML with units.

>>> from chilopod import load_robot
>>> robot = load_robot("aoi2022-planar").override("springs.stiffness[0]", "12 N*mm/deg")
>>> robot.get("springs.stiffness[0]")
0.6875493541569879
"""

from chilopod.robot.files import Table, presets
from chilopod.robot.model import Robot, load_robot
from chilopod.robot.parts import Body, Legs, Springs, Twin
from chilopod.robot.remarks import remarks

__all__ = ["Body", "Legs", "Robot", "Springs", "Table", "Twin", "load_robot", "presets", "remarks"]
