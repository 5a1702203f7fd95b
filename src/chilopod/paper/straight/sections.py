"""The straight walk and where it bends: the sections of this chapter."""

from __future__ import annotations

import xarray as xr

from chilopod.paper.fit_data import critical_mode_data, variant_settings
from chilopod.paper.section import Section
from chilopod.paper.straight import rows, study
from chilopod.paper.straight.figures import critical, mode, uniform
from chilopod.show.figures import exponents, identification
from chilopod.tasks.identify import Identification, identify_planar

CHAPTER = "The straight walk and where it bends"

MODE: Section[xr.Dataset] = Section(
    "mode",
    CHAPTER,
    "the pitchfork in k1 and its mode",
    lambda context, found, report: study.critical_mode(context.robot),
    lambda data, found: rows.mode_rows(data),
    lambda data, found: [mode.panel(data)],
)
EXPONENTS: Section[xr.Dataset] = Section(
    "exponents",
    CHAPTER,
    "Floquet exponents as k1 falls",
    lambda context, found, report: study.exponent_sweep(context.robot, context.size.of(160, 40, 12), report),
    panels=lambda data, found: [exponents.panel(data, found[MODE])],
    beside=(MODE,),
)
VARIANTS: Section[xr.Dataset] = Section(
    "variants",
    CHAPTER,
    "critical k1 for the paper's variants",
    lambda context, found, report: study.variants(context.robot, report),
    lambda data, found: rows.variant_rows(data),
    lambda data, found: [critical.variants(data)],
)
MODULES: Section[xr.Dataset] = Section(
    "modules",
    CHAPTER,
    "critical k1 over the number of modules",
    lambda context, found, report: study.module_counts(context.robot, range(3, context.size.of(21, 11, 8)), report),
    lambda data, found: rows.module_rows(data),
    lambda data, found: [critical.modules(data, found.context.robot)],
)
UNIFORM: Section[xr.Dataset] = Section(
    "uniform",
    CHAPTER,
    "the Neimark-Sacker point of uniform springs",
    lambda context, found, report: study.uniform_springs(context.robot),
    lambda data, found: rows.uniform_rows(data),
    lambda data, found: [uniform.panel(data, found.context.robot)],
)
IDENTIFICATION: Section[Identification] = Section(
    "identification",
    CHAPTER,
    "the constants the paper does not print",
    lambda context, found, report: identify_planar(
        context.robot, critical_mode_data(), context.size.of(25, 7, 5), variant_settings(), report
    ),
    lambda fit, found: rows.identification_rows(fit),
    lambda fit, found: [identification.panel(fit)],
    beyond=True,
)
