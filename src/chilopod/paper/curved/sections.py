"""Curved walks: the sections of this chapter."""

from __future__ import annotations

import xarray as xr

from chilopod.analysis.branch import curved_walks
from chilopod.analysis.parameters import K1, stiffness
from chilopod.analysis.undulation import DISTANCES, undulating_walks
from chilopod.paper.curved import figures
from chilopod.paper.curved.rows import rows
from chilopod.paper.curved.study import CurvedStudy, curved_study
from chilopod.paper.section import Section
from chilopod.show.figures import branch, undulation

CHAPTER = "Curved walks"

_SPRINGS = (stiffness(6.0), stiffness(20.0))

CURVED: Section[CurvedStudy] = Section(
    "curved", CHAPTER, "walks from straight on, trial by trial", curved_study, rows, figures.panels
)
BRANCH: Section[xr.Dataset] = Section(
    "branch",
    CHAPTER,
    "the curved walks beyond the pitchfork",
    lambda context, report: curved_walks(context.robot, K1, _SPRINGS, longest=0.05, progress=report),
    panels=branch.panel,
)
UNDULATION: Section[xr.Dataset] = Section(
    "undulation",
    CHAPTER,
    "undulating walks of uniform springs",
    lambda context, report: undulating_walks(context.robot, context.size.cut(DISTANCES, DISTANCES[-2:]), report),
    panels=undulation.panel,
)
