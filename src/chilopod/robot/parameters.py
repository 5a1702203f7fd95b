"""Dotted paths of a robot's numbers, such as ``gait.stride`` or ``springs.stiffness[0]``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from chilopod.errors import ParameterError, nearest_name
from chilopod.gait import Gait
from chilopod.ground import Ground
from chilopod.robot.parts import Body, Legs, Springs, Twin
from chilopod.units import Description, Quantity, quantities

_PATH: Final = re.compile(r"([a-z_]+\.[a-z_]+)(?:\[([0-9]{1,6})\])?")
_GROUP: Final = re.compile(r"([a-z_]+\.[a-z_]+)\[([0-9]{0,6}):([0-9]{0,6})\]")
_INDEX: Final = re.compile(r"\s*([0-9]{1,6})\s*\]?\s*")  # tolerates spaces and a missing bracket


@dataclass(frozen=True, slots=True)
class Place:
    """Place of a parameter: section, key, index among the springs, slice of a group or None for all; and its values."""

    section: str
    key: str
    index: int | slice | None
    quantity: Quantity

    def joints(self, count: int) -> range:
        """Indices of the springs that it means, of a robot with so many joints; empty if it has none of them."""
        if isinstance(self.index, int):
            return range(self.index, min(self.index + 1, count))
        return range(count)[self.index or slice(None)]


_PARTS: Final[tuple[type[Description], ...]] = (Body, Springs, Legs, Gait, Ground, Twin)
SECTIONS: Final = {part.__name__.lower(): part for part in _PARTS}
QUANTITIES: Final = {
    f"{section}.{key}": quantity for section, model in SECTIONS.items() for key, quantity in quantities(model).items()
}
"""Quantity of every number of a robot by its path, with one entry for all springs."""


@lru_cache(maxsize=1024)
def place_of(path: str) -> Place:
    """Read a dotted path such as ``springs.stiffness[0]``, or ``springs.stiffness[1:]`` for a group; whether the robot
    has that many springs is not checked. ParameterError, with the nearest path, if it is not the path of a number."""
    known = QUANTITIES
    match, group = _PATH.fullmatch(path), _GROUP.fullmatch(path)
    stem, index = match.groups() if match else (group[1] if group else path, None)
    if stem not in known:
        if stem.partition(".")[0] in ("name", "provenance"):
            raise ParameterError("must be the path of a parameter, not of a text", field=path, allowed=", ".join(known))
        bare, _, rest = path.partition("[")
        # "stiffness" alone, or under a wrong section, is nearer to what was meant than spelling can tell.
        same_key = (name for name in known if name.partition(".")[2] == bare.rpartition(".")[2])
        nearest = next(same_key, None) or nearest_name(bare, known)
        if nearest is None:
            raise ParameterError("must be the path of a parameter", field=path, allowed=", ".join(known))
        meant = _INDEX.fullmatch(rest) if known[nearest].each else None
        nearest = f"{nearest}[{meant[1]}]" if meant else nearest
        raise ParameterError("must be the path of a parameter", field=path, nearest=nearest)
    quantity = known[stem]
    if (index is not None or group) and not quantity.each:
        raise ParameterError("must be written without an index", field=path, allowed=stem)
    section, key = stem.split(".")
    if group:
        return Place(section, key, slice(*(int(end) if end else None for end in group.groups()[1:])), quantity)
    return Place(section, key, None if index is None else int(index), quantity)


def spring_index(path: str, changed: str) -> int:
    """Return the index of a spring in a path that a change of `changed` concerns, -1 for any other path."""
    match = _PATH.fullmatch(path)
    if match is None or match[2] is None or (changed != "body.modules" and match[1] != changed):
        return -1
    return int(match[2])
