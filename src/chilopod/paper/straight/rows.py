"""What the paper prints of its Floquet analysis, beside what is computed."""

from __future__ import annotations

import numpy as np
import xarray as xr

from chilopod.paper.fit_data import K1_ROUNDING, MODE_ROUNDING
from chilopod.paper.printed import printed
from chilopod.paper.table import Row, agrees
from chilopod.tasks.identify import Identification


def mode_rows(data: xr.Dataset) -> list[Row]:
    """The pitchfork and its mode."""
    table = printed()["pitchfork"]
    value, bound = data.attrs["value"], data.attrs["error_bound"]
    paper = float(table["critical_k1"].split()[0])
    rows = [
        Row(
            "critical k1 of the planar model",
            table["critical_k1"],
            f"{value:.9f} ± {bound:.0e} N*mm/deg",
            table["source"],
            agrees(abs(value - paper) <= K1_ROUNDING),
        ),
        Row(
            "kind and direction",
            "pitchfork (from the exponent crossing on the real axis)",
            f"{data.attrs['kind']}, {data.attrs['criticality']} "
            f"(coefficient {data.attrs['coefficient']:.4g} /rad² per cycle)",
            table["source"],
            "agrees",
            "the paper's linear analysis does not give a direction",
        ),
    ]
    for joint, (computed, paper) in enumerate(zip(data.computed.values, data.printed.values, strict=True), 1):
        if np.isnan(paper):
            continue
        off = abs(computed - paper)
        rows.append(
            Row(
                f"critical mode, joint {joint}",
                f"{paper:.2f}",
                f"{computed:.4f}",
                table["source"],
                agrees(off <= MODE_ROUNDING),
                "" if off <= MODE_ROUNDING else f"beyond rounding by {off - MODE_ROUNDING:.4f}; see the best fit below",
            )
        )
    return rows


def variant_rows(data: xr.Dataset) -> list[Row]:
    """The paper's variants."""
    table = printed()["pitchfork"]
    base = float(data.critical_k1[0])
    rows = [
        Row(
            "critical k1 of the robot (square-root fit to trials)",
            table["robot_critical_k1"],
            f"{base:.3f} N*mm/deg (planar model)",
            table["robot_source"],
            "differs",
            "the paper's own planar model has 12 as well; it leaves the difference to the robot open",
        )
    ]
    for name, value, robot, says in zip(
        data.variant.values[1:],
        data.critical_k1.values[1:],
        data.robot_printed.values[1:],
        data.paper_says.values[1:],
        strict=True,
    ):
        fits = value < 0.95 * base if says == "lower" else abs(value / base - 1.0) < 0.1
        rows.append(
            Row(
                f"critical k1, {name}",
                f"model: {says} (robot: {robot:g} N*mm/deg)",
                f"{value:.3f} N*mm/deg ({100 * (value / base - 1):+.0f} %)",
                "figure Floquet analysis, C",
                agrees(fits),
            )
        )
    return rows


def module_rows(data: xr.Dataset) -> list[Row]:
    """Longer robots."""
    longer = data.sel(modules=data.modules > 6).critical_k1
    base = float(data.sel(modules=6).critical_k1)
    off = np.abs(longer / base - 1.0)
    return [
        Row(
            f"critical k1 for 7 to {int(data.modules[-1])} modules of the same size",
            printed()["modules"]["model"],
            f"{float(longer.min()):.2f} to {float(longer.max()):.2f} N*mm/deg",
            printed()["modules"]["source"],
            agrees(bool((off < 0.1).all())),
        )
    ]


def uniform_rows(data: xr.Dataset) -> list[Row]:
    """All springs alike."""
    table = printed()["uniform"]
    return [
        Row(
            "uniform springs: critical k of the planar model",
            f"not printed (robot: about {table['robot_critical_k']})",
            f"{data.attrs['value']:.9f} ± {data.attrs['error_bound']:.0e} N*mm/deg",
            table["source"],
            "not printed",
        ),
        Row(
            "uniform springs: kind",
            f'{table["kind"]} ("Hopf")',
            f"{data.attrs['kind']}, {data.attrs['criticality']}, {data.attrs['frequency_rad_s']:.4f} rad/s: "
            f"a cycle of {data.attrs['oscillation_period_s']:.1f} s",
            table["source"],
            agrees(data.attrs["kind"] == table["kind"]),
        ),
    ]


def identification_rows(found: Identification) -> list[Row]:
    """The constants the paper does not print."""
    best = found.best
    profile = found.profile
    inside = profile.forward_offset.values[profile.largest_residual.values <= 1.0]
    span = f"{1e3 * inside.min():.0f} to {1e3 * inside.max():.0f} mm" if inside.size else "nowhere"
    return [
        Row(
            "foot friction, half-width, forward offset",
            "not printed",
            f"{best.ground.friction:.1f} N*s/m, {1e3 * best.legs.half_width:.1f} mm, "
            f"{1e3 * best.legs.forward_offset:.1f} mm",
            printed()["pitchfork"]["source"],
            "not printed",
            f"best fit, largest residual {np.abs(found.residuals).max():.2f} of rounding "
            f"(this robot: {np.abs(found.preset_residuals).max():.2f}); rounding allows forward offsets of {span}",
        )
    ]
