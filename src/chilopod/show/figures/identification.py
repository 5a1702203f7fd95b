"""Figures of identified constants."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from chilopod.frozen import Array
from chilopod.robot import Robot
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, listing, number, typeset
from chilopod.tasks.identify import Identification, RecordedIdentification, TwinIdentification

_COLUMNS = {
    *("friction", "half_width", "largest_residual", "critical_k1"),
    *("uniform", "coefficient", "verdict"),
}
"""Columns of a profile that are no variants."""


def panel(found: Identification | RecordedIdentification | TwinIdentification) -> Panel:
    """Figure of a result: profiles of the planar model's constants, or data as measured and as computed."""
    if isinstance(found, Identification):
        return _profiles(found)
    if isinstance(found, RecordedIdentification):
        data = found.walks
    else:
        data = xr.Dataset({"residual": ("datum", found.fits[0].residuals)}, {"datum": list(found.data.names)})
    return Panel(
        name="identification",
        title="Data as computed with the best constants",
        draw=_draw_data(found),
        alt="Joint angles over time, dots as recorded and lines as computed, or the residual of each datum.",
        text=tuple(found.lines()),
        data=data,
    )


@style.in_layouts(style.Layout("A", 5.0), style.Layout("A", 5.0))
def _draw_data(axes: style.Mosaic, found: RecordedIdentification | TwinIdentification) -> None:
    found.plot(axes["A"])


def _profiles(fit: Identification) -> Panel:
    """The profile of a fit, with the robot it was given beside."""
    data, best, count = fit.profile, fit.best, len(fit.residuals)
    inside = data.largest_residual.values <= 1.0
    largest, ours = (float(np.abs(each).max()) for each in (fit.residuals, fit.preset_residuals))
    return Panel(
        name="identification",
        title="The constants of the feet",
        draw=_draw(fit),
        alt="Six profiles over the forward offset of the feet: largest residual, friction, half-width, predictions for "
        "the variants and for uniform springs, and the coefficient of the pitchfork with its change of sign.",
        text=(
            "How hard the feet hold on the floor (friction), how far they stand to the side (half-width) and how far "
            f"ahead of the middle of their module (forward offset) is fitted to {count} numbers: the critical spring "
            f"and the {count - 1} components of the mode. A residual of 1 is the tolerance of a number; for printed "
            "numbers that is half of the last digit, so that below 1 a computed number rounds to the printed one. The "
            "curves have, at each forward offset, the friction and the half-width whose largest residual is smallest.",
            f"The best fit has {best.ground.friction:.1f} N·s/m, {1e3 * best.legs.half_width:.1f} mm and "
            f"{1e3 * best.legs.forward_offset:.1f} mm, the least squares of the residuals, with a largest residual of "
            f"{number(largest, 2)}: {'all' if largest <= 1.0 else 'not all'} {count} are met. "
            + f"This robot, with {1e3 * fit.given.legs.forward_offset:.1f} mm, has {number(ours, 3)}. "
            + _valley(fit),
            _predicted(data, inside),
            _verdict(data, inside),
        ),
        data=data,
    )


def _valley(fit: Identification) -> str:
    allowed = fit.allowed("legs.forward_offset")
    if allowed is None:
        return "No constants meet all of them."
    return (
        f"The valley is flat: for every forward offset between {1e3 * allowed[0]:.0f} and {1e3 * allowed[1]:.0f} mm "
        "(shaded) there are values of the other two with which all of the numbers come out."
    )


def _variants_of(data: xr.Dataset) -> list[str]:
    return [str(name) for name in data if name not in _COLUMNS]


def _predicted(data: xr.Dataset, inside: NDArray[np.bool_]) -> str:
    if not inside.any():
        return "So nothing can be said of numbers that were not fitted."

    def span(name: str) -> str:
        values = data[name].values[inside & np.isfinite(data[name].values)]
        return f"{number(values.min())} to {number(values.max())}" if values.size else "not found"

    variants = listing(f"{span(name)} for {typeset(name)}" for name in _variants_of(data))
    others = f"Along the shaded valley the critical spring of variants, which were not fitted, is {variants}. "
    return (
        f"{others if variants else ''}The critical spring of a uniform body, which was not fitted, is "
        f"{span('uniform')} along the valley (all in {SPRING_UNIT})."
    )


def _verdict(data: xr.Dataset, inside: NDArray[np.bool_]) -> str:
    words = set(data.verdict.values[inside]) - {""}
    where = _changes(data)
    if len(words) > 1 and where.size:
        return (
            "The direction of the pitchfork changes within the valley: its coefficient passes zero near a forward "
            f"offset of {listing(f'{1e3 * x:.1f} mm' for x in where)}, from {data.verdict.values[0]} on the left to "
            f"{data.verdict.values[-1]} on the right. So the data do not decide whether the bend of this "
            "model sets in gently or with a jump."
        )
    if len(words) == 1:
        return f"The direction of the pitchfork is {words.pop()} everywhere in the valley."
    return "The profile gives no direction of the pitchfork."


def _changes(data: xr.Dataset) -> Array:
    """Forward offsets at which the coefficient passes zero, read off between the points of the profile."""
    x, y = data.forward_offset.values, data.coefficient.values
    at = np.flatnonzero(y[:-1] * y[1:] < 0.0)
    return np.asarray(x[at] - y[at] * (x[at + 1] - x[at]) / (y[at + 1] - y[at]))


@style.in_layouts(style.Layout("ABC;DEF", 6.2), style.Layout("A;B;C;D;E;F", 17.0))
def _draw(axes: style.Mosaic, fit: Identification) -> None:
    data = fit.profile
    x = 1e3 * data.forward_offset.values
    allowed = fit.allowed("legs.forward_offset")
    for one in axes.values():
        if allowed is not None:
            one.axvspan(1e3 * allowed[0], 1e3 * allowed[1], color=style.PALE, lw=0, label="tolerances allow")
        one.set(xlim=(x[0], x[-1]), xlabel="forward offset (mm)")
    _fitted(axes["A"], x, data.largest_residual.values, "How well the data are met", "largest residual")
    axes["A"].axhline(1.0, color=style.BLACK, lw=1.0, linestyle=":")
    axes["A"].set_ylim(0.0, 1.15 * max(data.largest_residual.values.max(), 1.0))
    _fitted(axes["B"], x, data.friction.values, "Friction fitted", "friction (N·s/m)")
    _fitted(axes["C"], x, 1e3 * data.half_width.values, "Half-width fitted", "half-width (mm)")
    _mark(axes, fit.best, fit.residuals, "D", color=style.VERMILLION, markerfacecolor="white", label="best fit")
    _mark(axes, fit.given, fit.preset_residuals, "o", color=style.BLUE, label="this robot")
    _variants(axes["D"], x, data)
    _fitted(axes["E"], x, data.uniform.values, "Not fitted: uniform springs", f"critical k ({SPRING_UNIT})")
    _coefficient(axes["F"], x, data)
    axes.figure.legend(*axes["A"].get_legend_handles_labels(), loc="outside upper left", ncols=1 if axes.narrow else 4)


def _fitted(axes: Axes, x: Array, values: Array, title: str, label: str) -> None:
    axes.plot(x, values, color=style.BLACK)
    axes.set(title=title, ylabel=label)


def _mark(axes: dict[str, Axes], robot: Robot, residuals: Array, marker: str, **look: Any) -> None:
    """Position of a robot in the three panels of the fit."""
    offset, values = 1e3 * robot.legs.forward_offset, (robot.ground.friction, 1e3 * robot.legs.half_width)
    for letter, value in zip("ABC", (np.abs(residuals).max(), *values), strict=True):
        axes[letter].plot(offset, value, marker, markeredgewidth=1.6, markersize=6.5, zorder=5, **look)


def _variants(axes: Axes, x: Array, data: xr.Dataset) -> None:
    names = _variants_of(data) or ["critical_k1"]
    axes.set_title("Not fitted: variants" if _variants_of(data) else "Critical spring")
    for index, name in enumerate(names):
        values = data[name].values
        axes.plot(x, values, color=style.CURVES[index], linestyle=("-", "--", "-.")[index % 3])
        # Curves rise: there is room above the left of the highest and below the right of the others.
        place, away, ha, va = len(x) // 3, -5, "left", "top"
        if name == max(names, key=lambda each: float(data[each].mean())):
            place, away, ha, va = int(0.75 * len(x)), 5, "right", "bottom"
        style.note(
            axes, typeset(name) if _variants_of(data) else "", (x[place], values[place]), (0, away), ha=ha, va=va
        )
    values = np.array([data[name].values for name in names])
    axes.set_ylabel(f"critical k₁ ({SPRING_UNIT})")
    if np.isfinite(values).any():
        room = 0.04 * np.nanmax(values)  # for the notes
        axes.set_ylim(np.nanmin(values) - room, np.nanmax(values) + room)


def _coefficient(axes: Axes, x: Array, data: xr.Dataset) -> None:
    values = data.coefficient.values
    _fitted(axes, x, values, "Not fitted: direction", "coefficient (1/rad² per cycle)")
    axes.axhline(0.0, color=style.BLACK, lw=0.8)
    for word, fill, marker in (("supercritical", style.BLACK, "o"), ("subcritical", "white", "s")):
        those = data.verdict.values == word
        axes.plot(x[those], values[those], marker, color=style.BLACK, markerfacecolor=fill, markersize=4)
    for place in 1e3 * _changes(data):
        axes.axvline(place, color=style.VERMILLION, lw=1.2, linestyle="--")
        style.note(axes, f"changes at\n{place:.1f} mm", (place, 0.0), (6, 10))
    high = np.abs(values[np.isfinite(values)]).max(initial=np.finfo(float).tiny)
    axes.set_ylim(-1.5 * high, 1.5 * high)
    for at, words, va in ((0.97, "subcritical", "top"), (0.03, "supercritical", "baseline")):
        axes.text(0.97, at, words, transform=axes.transAxes, ha="right", va=va, fontsize=style.SMALL)
