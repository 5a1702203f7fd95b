"""The straight walk and where it bends: the sections of this chapter."""

from __future__ import annotations

import xarray as xr

from chilopod.paper.section import Section
from chilopod.paper.straight import figures, rows, study
from chilopod.show.figures import exponents, identification
from chilopod.tasks.identify import Identification

CHAPTER = "The straight walk and where it bends"

MODE: Section[xr.Dataset] = Section(
    "mode", CHAPTER, "the pitchfork in k1 and its mode", study.critical_mode, rows.mode_rows, figures.mode
)
EXPONENTS: Section[xr.Dataset] = Section(
    "exponents", CHAPTER, "Floquet exponents as k1 falls", study.exponent_sweep, panels=exponents.panel, beside=(MODE,)
)
VARIANTS: Section[xr.Dataset] = Section(
    "variants", CHAPTER, "critical k1 for the paper's variants", study.variants, rows.variant_rows, figures.variants
)
MODULES: Section[xr.Dataset] = Section(
    "modules", CHAPTER, "critical k1 over the number of modules", study.module_counts, rows.module_rows, figures.modules
)
UNIFORM: Section[xr.Dataset] = Section(
    "uniform",
    CHAPTER,
    "the Neimark-Sacker point of uniform springs",
    study.uniform_springs,
    rows.uniform_rows,
    figures.uniform,
)
IDENTIFICATION: Section[Identification] = Section(
    "identification",
    CHAPTER,
    "the constants the paper does not print",
    study.identified,
    rows.identification_rows,
    identification.panel,
    beyond=True,
)
