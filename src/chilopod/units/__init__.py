"""Quantities with units at the edges of chilopod; SI and radians inside.

>>> from chilopod import units
>>> units.parse("41 N*mm/deg", "N*m/rad")
2.3491269600363753
>>> units.format(units.parse("41 N*mm/deg", "N*m/rad"), "N*mm/deg")
'41 N*mm/deg'
"""

from chilopod.units.expressions import Unit, format, from_si, parse, unit, unit_in
from chilopod.units.quantity import Description, Flag, Quantity, quantities

__all__ = ["Description", "Flag", "Quantity", "Unit", "format", "from_si", "parse", "quantities", "unit", "unit_in"]
