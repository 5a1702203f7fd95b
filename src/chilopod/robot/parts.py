"""The parts of a robot that only the robot has: its chain of modules, their joints, their feet."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final

from pydantic import model_validator

from chilopod.units import Description, Quantity
from chilopod.units.quantity import is_list

MODULES: Final = Quantity("", "", at_least=2, at_most=1000, integer=True)


class Body(Description):
    """The chain of modules, all alike, joined end to end.

    Attributes
    ----------
    modules
        How many, from 2 to 1000.
    length
        Of the whole chain, m.
    mass
        Of the whole chain, kg.
    yaw_inertia
        Of one module about its centre, kg*m^2; None means a uniform rod.
    """

    modules: Annotated[int, MODULES]
    length: Annotated[float, Quantity("m", "m")]
    mass: Annotated[float, Quantity("kg", "kg")]
    yaw_inertia: Annotated[float | None, Quantity("kg*m^2", "kg*m^2", optional=True)] = None


class Springs(Description):
    """Torsional springs and dampers of the yaw joints, front to rear.

    Attributes
    ----------
    stiffness
        (modules-1,) N*m/rad, positive.
    damping
        (modules-1,) N*m*s/rad, zero or more; a single value stands for all joints.
    """

    stiffness: Annotated[tuple[float, ...], Quantity("N*m/rad", "N*mm/deg", each=True)]
    damping: Annotated[tuple[float, ...], Quantity("N*m*s/rad", "N*m*s/rad", at_least=0.0, each=True)]

    @model_validator(mode="before")
    @classmethod
    def _spread_damping(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and is_list(data.get("stiffness")):
            return spread(data, "damping", len(data["stiffness"]))
        return data


class Legs(Description):
    """Where each foot is at mid-stroke, relative to the centre of its module.

    Attributes
    ----------
    forward_offset
        Distance ahead, m, of either sign.
    half_width
        Distance to the side, m, zero or more.
    """

    forward_offset: Annotated[float, Quantity("m", "m", at_least=-1e9)]
    half_width: Annotated[float, Quantity("m", "m", at_least=0.0)]


def spread(table: Mapping[str, Any], key: str, count: int) -> Mapping[str, Any]:
    """Return `table` with a single value under `key` repeated `count` times."""
    if key not in table or is_list(table[key]) or isinstance(table[key], Mapping):
        return table
    return {**table, key: [table[key]] * count}
