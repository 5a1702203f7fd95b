"""Sections on the straight walk and its bifurcations, with their rows of the tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr

from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper import printed, statements
from chilopod.paper.printed import ANALYSIS
from chilopod.paper.section import Section
from chilopod.paper.straight import exponents, figures, study
from chilopod.paper.table import OfPlanar, Result, Row, agreement, unprinted
from chilopod.show.figures import identification
from chilopod.tasks.identify import Identification

CHAPTER = "The straight walk and where it bends"


def mode_rows(data: xr.Dataset) -> list[Row]:
    """The pitchfork and its mode."""
    found, said = data.attrs, printed.CRITICAL_K1
    kind = f"{found['kind']}, {found['criticality']} (coefficient {found['coefficient']:.4g} /rad² per cycle)"
    crossing, same = f"{printed.KIND} (from the exponent crossing on the real axis)", found["kind"] == printed.KIND
    remark = "the paper's linear analysis does not give a direction"
    rows = [
        Row("critical k1", str(said), _located(data), ANALYSIS, agreement(said.band.holds(found["value"]))),
        Row("kind and direction", crossing, Result(kind), ANALYSIS, agreement(same), remark),
    ]
    known = printed.MODE if len(data.computed) == len(printed.MODE) else ()
    for joint, (computed, paper) in enumerate(zip(data.computed.values, known, strict=False), 1):
        beyond = abs(computed - paper.value) - paper.tolerance
        remark = f"beyond rounding by {beyond:.4f}" if beyond > 0.0 else ""
        result, verdict = Result(value=computed, error=0.0, digits=4), agreement(paper.band.holds(computed))
        rows.append(Row(f"critical mode, joint {joint}", f"{paper.value:.2f}", result, ANALYSIS, verdict, remark))
    return rows


def variant_rows(data: xr.Dataset) -> list[Row]:
    """The paper's variants."""
    base = float(data.critical_k1.sel(variant=printed.AS_BUILT))
    rows = []
    for name, variant in printed.VARIANTS.items():
        value = float(data.critical_k1.sel(variant=name))
        words = f"{value:.3f} {PAPER_UNIT} ({100 * (value / base - 1):+.0f} %)"
        result, verdict = Result(words, value, unit=PAPER_UNIT), agreement(variant.model.holds(value / base))
        rows.append(Row(f"critical k1, {name}", variant.model.words, result, "figure Floquet analysis, C", verdict))
    return rows


def module_rows(data: xr.Dataset) -> list[Row]:
    """Longer robots."""
    longer = data.sel(modules=data.modules > 6).critical_k1
    base, said = float(data.sel(modules=6).critical_k1), printed.LITTLE_CHANGE
    quantity = f"critical k1 for 7 to {int(data.modules[-1])} modules of the same size"
    result = Result(f"{float(longer.min()):.2f} to {float(longer.max()):.2f} {PAPER_UNIT}")
    verdict = agreement(all(said.holds(float(value) / base) for value in longer))
    return [Row(quantity, said.words, result, f"{ANALYSIS}, figure D", verdict)]


def uniform_rows(data: xr.Dataset) -> list[Row | OfPlanar]:
    """All springs alike."""
    found = data.attrs
    cycle = f"{found['frequency_rad_s']:.4f} rad/s: a cycle of {found['oscillation_period_s']:.1f} s"
    kind = Result(f"{found['kind']}, {found['criticality']}, {cycle}")
    said, verdict = f'{printed.UNIFORM_KIND} ("Hopf")', agreement(found["kind"] == printed.UNIFORM_KIND)
    return [
        unprinted("uniform springs: critical k", _located(data), printed.COMPARISON),
        Row("uniform springs: kind", said, kind, ANALYSIS, verdict),
        OfPlanar(statements.UNIFORM, Result(value=found["value"], unit=PAPER_UNIT)),
    ]


def identification_rows(found: Identification) -> list[Row]:
    """The constants the paper does not print."""
    legs, allowed = found.best.legs, found.allowed("legs.forward_offset")
    span = "nowhere" if allowed is None else f"{1e3 * allowed[0]:.0f} to {1e3 * allowed[1]:.0f} mm"
    friction, width, offset = found.best.ground.friction, 1e3 * legs.half_width, 1e3 * legs.forward_offset
    largest, ours = (np.abs(each).max() for each in (found.residuals, found.preset_residuals))
    remark = (
        f"best fit, largest residual {largest:.2f} of rounding (this robot: {ours:.2f}); rounding allows forward "
        f"offsets of {span}"
    )
    words = f"{friction:.1f} N*s/m, {width:.1f} mm, {offset:.1f} mm"
    return [unprinted("foot friction, half-width, forward offset", words, ANALYSIS, remark)]


def _located(data: xr.Dataset) -> Result:
    """Critical spring with the bound of its error."""
    value, bound = float(data.attrs["value"]), float(data.attrs["error_bound"])
    return Result(f"{value:.9f} ± {bound:.0e} {PAPER_UNIT}", value, bound, PAPER_UNIT)


MODE: Section[xr.Dataset] = Section(
    "mode", CHAPTER, "the pitchfork in k1 and its mode", study.critical_mode, mode_rows, figures.mode
)
EXPONENTS: Section[xr.Dataset] = Section(
    "exponents", CHAPTER, "Floquet exponents as k1 falls", study.exponent_sweep, panels=exponents.panel, beside=(MODE,)
)
VARIANTS: Section[xr.Dataset] = Section(
    "variants", CHAPTER, "critical k1 for the paper's variants", study.variants, variant_rows, figures.variants
)
MODULES: Section[xr.Dataset] = Section(
    "modules", CHAPTER, "critical k1 over the number of modules", study.module_counts, module_rows, figures.modules
)
UNIFORM: Section[xr.Dataset] = Section(
    "uniform",
    CHAPTER,
    "the Neimark-Sacker point of uniform springs",
    study.uniform_springs,
    uniform_rows,
    figures.uniform,
)
IDENTIFICATION: Section[Identification] = Section(
    "identification",
    CHAPTER,
    "the constants the paper does not print",
    study.identified,
    identification_rows,
    lambda found: replace(identification.panel(found), letter="G", title="The constants the paper does not print"),
    beyond=True,
    headline=True,
)
