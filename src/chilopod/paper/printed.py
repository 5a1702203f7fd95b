"""What the paper prints, as data with its source."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

from chilopod import units


@cache
def printed() -> dict[str, Any]:
    """The table of printed values (``printed.toml``)."""
    return tomllib.loads(files("chilopod.paper").joinpath("printed.toml").read_text(encoding="utf-8"))


def printed_stiffness(*keys: str) -> float:
    """A printed spring constant, N*m/rad."""
    entry: Any = printed()
    for key in keys:
        entry = entry[key]
    return units.parse(entry, "N*m/rad")
