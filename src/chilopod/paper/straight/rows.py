"""Rows on the Floquet analysis: the paper's numbers beside what is computed."""

from __future__ import annotations

import numpy as np
import xarray as xr

from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper import printed, statements
from chilopod.paper.printed import ANALYSIS
from chilopod.paper.scatter import every
from chilopod.paper.table import OfPlanar, Result, Row, agreement, unprinted
from chilopod.tasks.identify import Identification


def mode_rows(data: xr.Dataset) -> list[Row]:
    """The pitchfork and its mode."""
    found, said = data.attrs, printed.CRITICAL_K1
    kind = f"{found['kind']}, {found['criticality']} (coefficient {found['coefficient']:.4g} /rad² per cycle)"
    rows = [
        Row("critical k1", str(said), _located(data), ANALYSIS, agreement(said.answer(found["value"]))),
        Row(
            "kind and direction",
            f"{printed.KIND} (from the exponent crossing on the real axis)",
            Result(kind),
            ANALYSIS,
            agreement(found["kind"] == printed.KIND),
            "the paper's linear analysis does not give a direction",
        ),
    ]
    known = printed.MODE if len(data.computed) == len(printed.MODE) else ()
    for joint, (computed, paper) in enumerate(zip(data.computed.values, known, strict=False), 1):
        beyond = abs(computed - paper.value) - paper.tolerance
        remark = f"beyond rounding by {beyond:.4f}" if beyond > 0.0 else ""
        result, verdict = Result(value=computed, error=0.0, digits=4), agreement(paper.answer(computed))
        rows.append(Row(f"critical mode, joint {joint}", f"{paper.value:.2f}", result, ANALYSIS, verdict, remark))
    return rows


def variant_rows(data: xr.Dataset) -> list[Row]:
    """The paper's variants."""
    base = float(data.critical_k1.sel(variant=printed.AS_BUILT))
    rows = []
    for name, variant in printed.VARIANTS.items():
        value = float(data.critical_k1.sel(variant=name))
        words = f"{value:.3f} {PAPER_UNIT} ({100 * (value / base - 1):+.0f} %)"
        result, verdict = Result(words, value, unit=PAPER_UNIT), agreement(variant.model.answer(value / base))
        rows.append(Row(f"critical k1, {name}", variant.model.words, result, "figure Floquet analysis, C", verdict))
    return rows


def module_rows(data: xr.Dataset) -> list[Row]:
    """Longer robots."""
    longer = data.sel(modules=data.modules > 6).critical_k1
    base, said = float(data.sel(modules=6).critical_k1), printed.LITTLE_CHANGE
    return [
        Row(
            f"critical k1 for 7 to {int(data.modules[-1])} modules of the same size",
            said.words,
            Result(f"{float(longer.min()):.2f} to {float(longer.max()):.2f} {PAPER_UNIT}"),
            f"{ANALYSIS}, figure D",
            agreement(every(said.answer(float(value) / base) for value in longer)),
        )
    ]


def uniform_rows(data: xr.Dataset) -> list[Row | OfPlanar]:
    """All springs alike."""
    found = data.attrs
    cycle = f"{found['frequency_rad_s']:.4f} rad/s: a cycle of {found['oscillation_period_s']:.1f} s"
    return [
        unprinted("uniform springs: critical k", _located(data), printed.COMPARISON),
        Row(
            "uniform springs: kind",
            f'{printed.UNIFORM_KIND} ("Hopf")',
            Result(f"{found['kind']}, {found['criticality']}, {cycle}"),
            ANALYSIS,
            agreement(found["kind"] == printed.UNIFORM_KIND),
        ),
        OfPlanar(statements.UNIFORM, Result(value=found["value"], unit=PAPER_UNIT)),
    ]


def identification_rows(found: Identification) -> list[Row]:
    """The constants the paper does not print."""
    legs, profile = found.best.legs, found.profile
    inside = profile.forward_offset.values[profile.largest_residual.values <= 1.0]
    span = f"{1e3 * inside.min():.0f} to {1e3 * inside.max():.0f} mm" if inside.size else "nowhere"
    return [
        unprinted(
            "foot friction, half-width, forward offset",
            f"{found.best.ground.friction:.1f} N*s/m, {1e3 * legs.half_width:.1f} mm, "
            f"{1e3 * legs.forward_offset:.1f} mm",
            ANALYSIS,
            f"best fit, largest residual {np.abs(found.residuals).max():.2f} of rounding "
            f"(this robot: {np.abs(found.preset_residuals).max():.2f}); rounding allows forward offsets of {span}",
        )
    ]


def _located(data: xr.Dataset) -> Result:
    """Critical spring with the bound of its error."""
    value, bound = float(data.attrs["value"]), float(data.attrs["error_bound"])
    return Result(f"{value:.9f} ± {bound:.0e} {PAPER_UNIT}", value, bound, PAPER_UNIT)
