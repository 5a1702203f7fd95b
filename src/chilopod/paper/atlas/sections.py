"""Sections of the atlas."""

from __future__ import annotations

import xarray as xr

from chilopod.analysis import StabilityMap
from chilopod.paper.atlas import maps, scaling
from chilopod.paper.section import Section

CHAPTER = "An atlas for designers"

SCALING: Section[xr.Dataset] = Section(
    "scaling",
    CHAPTER,
    "the scaling law of critical springs",
    scaling.collapse,
    panels=scaling.panel,
    beyond=True,
    headline=True,
)
ATLAS: Section[dict[str, StabilityMap]] = Section(
    "atlas",
    CHAPTER,
    "eight maps of the straight walk",
    maps.atlas,
    panels=maps.panel,
    needs=(SCALING,),
    beside=(SCALING,),
    beyond=True,
)
