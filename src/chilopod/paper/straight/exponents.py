"""B: Floquet exponents in the complex plane as k1 falls."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from chilopod.frozen import Array, ComplexArray
from chilopod.paper.shapes import finish
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, minus, number, spring

_MARKED = (75.0, 41.0, 28.0, 21.0, 15.0, 8.0, 4.0, 2.0)  # the paper's springs, and some below its crossing

_STAR: Any = {"marker": "*", "markersize": 15, "color": style.VERMILLION, "markeredgecolor": style.BLACK}


def panel(data: xr.Dataset, mode: xr.Dataset | None) -> Panel:
    """Exponents over k1; the crossing is the located pitchfork if there is one."""
    critical, value = _critical(data), None
    count = data.sizes["exponent"]
    first, last = float(data.k1[0]), float(data.k1[-1])
    fastest = float(data["real"].min())
    crosses = "none crosses"
    seen = "None of them crosses the imaginary axis in this range, so the straight walk keeps its stability."
    if critical is not None:
        value = _crossing(data, critical) if mode is None else float(mode.attrs["value"])
        crosses, seen = "one crosses into the right half-plane along the real axis", _seen(data, critical, value)
    return Panel(
        name="exponents",
        letter="B",
        title="Floquet exponents as k₁ falls",
        draw=_draw(data, value),
        alt=f"{count} Floquet exponents in the complex plane as the front spring falls from {first:g} to {last:g} "
        f"{SPRING_UNIT}: {crosses}.",
        text=(
            f"Each curve is one of the {count} Floquet exponents of the straight walk, followed while the front "
            f"spring k₁ is softened from {first:g} to {last:g} {SPRING_UNIT} and all other springs stay as they are. "
            "An exponent says how fast a small disturbance grows (right of zero) or dies out (left of zero), and how "
            "fast it swings (height).",
            seen,
            f"The exponents reach from near zero to {minus(f'{fastest:.0f}')} per second, so the scale is stretched "
            "around zero where all are shown. The paper's three exponents that are always zero (place and heading on "
            "the floor) are left out here by the choice of coordinates.",
        ),
        data=data,
    )


def _critical(data: xr.Dataset) -> int | None:
    found = np.flatnonzero(data.follows_critical.values)
    return int(found[0]) if found.size else None


def _seen(data: xr.Dataset, critical: int, value: float) -> str:
    born = np.flatnonzero(data["imaginary"].values[:, critical] == 0.0)
    rest = np.delete(data["real"].values, critical, axis=1)
    seen = (
        f"The one in vermillion (the paper's red) passes zero along the real axis at k₁ = {spring(value)}: below that "
        "spring a small bend no longer dies out but grows, to the left or to the right, without swinging. With the "
        "walk's symmetry of left and right that makes it a pitchfork. "
    )
    if (rest < 0.0).all():
        seen += "All others stay in the left half. "
    if born.size and born[0] > 0:
        seen += (
            "For stiff springs it is one of a complex pair, a bend that swings as it dies out; the two meet on the "
            f"real axis between k₁ = {number(data.k1[born[0] - 1])} and {number(data.k1[born[0]])}, and only one of "
            "them goes on to the right."
        )
    return seen


def _crossing(data: xr.Dataset, critical: int) -> float:
    """Zero of the curve, interpolated between the values of the sweep."""
    real = data["real"].values[:, critical]
    after = int(np.flatnonzero(real > 0.0)[0])
    beside = slice(after - 1, after + 1)
    return float(np.exp(np.interp(0.0, real[beside], np.log(data.k1.values[beside]))))


def _joined(data: xr.Dataset) -> tuple[Array, Array, Array]:
    """k1, real and imaginary parts of the curves, with added points where two of them meet and part, as straight lines
    between two values of the sweep would cut the corner there."""
    values, logs = data["real"].values + 1j * data["imaginary"].values, np.log(data.k1.values)
    rows, at = [values[:1]], [logs[:1]]
    for index, (start, end) in enumerate(zip(values[:-1], values[1:], strict=True)):
        share, between = _between(start, end)
        rows.append(between)
        at.append(logs[index] + share * (logs[index + 1] - logs[index]))
    table = np.concatenate(rows)
    return np.exp(np.concatenate(at)), table.real, table.imag


def _between(start: ComplexArray, end: ComplexArray) -> tuple[Array, ComplexArray]:
    """Parts of the way from one value of the sweep to the next, and the exponents there.

    Where a complex pair becomes two real exponents or the other way round, the mean of the two and the square of half
    their difference still change smoothly with k1.
    """
    pairs = []
    for one in np.flatnonzero((start.imag == 0.0) != (end.imag == 0.0)):
        paired = start if start[one].imag != 0.0 else end
        other = int(np.abs(paired - paired[one].conjugate()).argmin())
        half = 0.5 * np.array([start[one] - start[other], end[one] - end[other]])
        pairs.append((one, 0.5 * np.array([start[one] + start[other], end[one] + end[other]]).real, half))
    meetings = [(half[0] ** 2 / (half[0] ** 2 - half[1] ** 2)).real for *_, half in pairs]
    share = np.unique([*np.linspace(0.0, 1.0, 33)[1:], *meetings]) if pairs else np.ones(1)
    between = start + share[:, None] * (end - start)
    for one, mean, half in pairs:
        square = (half**2).real
        squares = square[0] + share * (square[1] - square[0])
        squares[np.abs(squares) < 1e-12 * np.abs(square).max()] = 0.0
        roots = np.sqrt(squares.astype(np.complex128))
        growing, swinging = np.sign(half[square.argmax()].real), np.sign(half[square.argmin()].imag)
        between[:, one] = mean[0] + share * (mean[1] - mean[0]) + growing * roots.real + 1j * swinging * roots.imag
    return share, between


@style.in_layouts(style.Layout("AA;BC", 7.4, heights=(1.15, 1.0)), style.Layout("A;B;C", 10.6))
def _draw(axes: style.Mosaic, data: xr.Dataset, crossing: float | None) -> None:
    critical = _critical(data)
    lead = 0 if critical is None else critical
    curves = ks, real, imaginary = _joined(data)
    colors = [style.CURVES[place % len(style.CURVES)] for place in range(data.sizes["exponent"])]
    if critical is not None:
        colors = [*colors[:lead], style.VERMILLION, *colors[lead:-1]]
    _near(axes["A"], real, imaginary, lead, colors)
    _labels(axes["A"], ks, real[:, lead], imaginary[:, lead], _MARKED[::2] if axes.narrow else _MARKED)
    _all(axes["B"], curves, lead, colors)
    _over_k1(axes["C"], ks, real, lead, colors)
    if crossing is not None:
        look: dict[str, Any] = {"textcoords": "offset points", "weight": "bold"}
        line = {"arrowstyle": "-", "color": style.BLACK, "lw": 0.8, "shrinkB": 7}
        for letter, place in (("A", 0.0), ("C", crossing)):
            axes[letter].plot(place, 0.0, zorder=8, **_STAR)
        words = f"crosses at\nk₁ = {number(crossing, 4)}\n{SPRING_UNIT}"
        axes["A"].annotate(words, (0.0, 0.0), (14, 42), arrowprops=line, **look)
        axes["C"].annotate(number(crossing), (crossing, 0.0), (-6, 9), ha="right", **look)


def _near(axes: Axes, real: Array, imaginary: Array, lead: int, colors: list[str]) -> None:
    axes.set_title("Near zero")
    low, high = real[:, lead].min(), real[:, lead].max()
    margin = 0.16 * (high - low)
    reach = 1.45 * max(np.abs(imaginary[:, lead]).max(), 0.1 * (high - low))
    axes.set(xlim=(low - 1.6 * margin, max(high, 0.0) + margin), ylim=(-reach, reach))
    _half_planes(axes)
    for index in _back_to_front(real.shape[1], lead):
        axes.plot(real[:, index], imaginary[:, index], color=colors[index], lw=2.6 if index == lead else 1.8)
        for share in (0.2, 0.55, 0.86):
            _arrow(axes, real[:, index], imaginary[:, index], share, colors[index])
    axes.set(xlabel="real part (1/s): dies out ← | → grows", ylabel="imaginary part (rad/s)")


def _labels(axes: Axes, ks: Array, real: Array, imaginary: Array, marked: tuple[float, ...]) -> None:
    """Values of k1 along the curve that crosses."""
    for k1 in marked:
        if not ks.min() - 1e-9 <= k1 <= ks.max() + 1e-9:
            continue
        x, y = (float(np.interp(np.log(k1), np.log(ks[::-1]), part[::-1])) for part in (real, imaginary))
        axes.plot(x, y, "o", color="white", markeredgecolor=style.VERMILLION, markersize=5.5, zorder=6)
        words, away, ha, va = f"{k1:g}", (0, -8), "center", "top"
        if k1 == max(marked):
            words, away, ha, va = f"k₁ =\n{k1:g}", (-8, 0), "right", "center"
        elif abs(y) > 1e-3:
            away, ha, va = (4, 7), "left", "bottom"
        style.note(axes, words, (x, y), away, ha=ha, va=va)


def _all(axes: Axes, curves: tuple[Array, Array, Array], lead: int, colors: list[str]) -> None:
    ks, real, imaginary = curves
    axes.set_title(f"All {real.shape[1]}, scale stretched around zero")
    axes.set_xscale("asinh", linear_width=0.05)
    ticks = [-1000.0, -100.0, -10.0, -1.0, -0.1, 0.0, 0.1, 1.0, 10.0]
    low, high = 1.6 * real.min(), max(1.6 * real.max(), 0.1)
    axes.set_xlim(low, high)
    _ticks(axes, [tick for tick in ticks if low <= tick <= high])
    reach = 1.5 * max(np.abs(imaginary).max(), 0.05)
    axes.set_ylim(-reach, reach)
    _half_planes(axes)
    for index in _back_to_front(real.shape[1], lead):
        axes.plot(real[:, index], imaginary[:, index], color=colors[index], lw=2.2)
        axes.plot(real[0, index], imaginary[0, index], "o", color="white", markeredgecolor=colors[index], markersize=6)
        axes.plot(real[-1, index], imaginary[-1, index], "o", color=colors[index], markersize=3.5)
    axes.set(xlabel="real part (1/s)", ylabel="imaginary part (rad/s)")
    for k1, fill, size in ((ks[0], "white", 6), (ks[-1], style.BLACK, 4)):
        look: dict[str, Any] = {"markeredgecolor": style.BLACK, "markersize": size, "label": f"k₁ = {k1:g}"}
        axes.plot([], [], "o", color=fill, **look)
    axes.legend(loc="upper left", handletextpad=0.2, borderaxespad=0.1)


def _over_k1(axes: Axes, ks: Array, real: Array, lead: int, colors: list[str]) -> None:
    """Draw the real parts of the slow exponents over k1."""
    axes.set_title("Growth rate of the slow ones")
    axes.set_xscale("log")
    axes.set_xlim(ks.max(), ks.min())
    high = max(real[:, lead].max(), 0.05)
    axes.set_ylim(-3.2 * max(high, np.abs(real[:, lead]).max()), 1.25 * high)
    axes.axhspan(0.0, 1.25 * high, color=style.VERMILLION, alpha=0.1, lw=0)
    axes.axhline(0.0, color=style.BLACK, lw=0.8)
    for index in _back_to_front(real.shape[1], lead):
        axes.plot(ks, real[:, index], color=colors[index], lw=2.6 if index == lead else 1.8)
    look: dict[str, Any] = {"transform": axes.get_yaxis_transform(), "va": "top", "fontsize": style.SMALL}
    axes.text(0.03, 1.125 * high, "unstable", **look)
    _ticks(axes, [tick for tick in (100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0) if ks.min() <= tick <= ks.max()])
    finish(axes, xlabel=f"k₁ ({SPRING_UNIT}), softer →", ylabel="real part (1/s)")


def _ticks(axes: Axes, places: list[float]) -> None:
    axes.set_xticks(places, [minus(f"{place:g}") for place in places])
    axes.xaxis.set_minor_locator(NullLocator())


def _half_planes(axes: Axes) -> None:
    axes.axvspan(0.0, axes.get_xlim()[1], color=style.VERMILLION, alpha=0.1, lw=0)
    axes.axhline(0.0, color=style.GREY, lw=0.7, zorder=1)
    axes.axvline(0.0, color=style.BLACK, lw=0.8, zorder=1)


def _back_to_front(count: int, lead: int) -> list[int]:
    return [*(index for index in range(count) if index != lead), lead]


def _arrow(axes: Axes, x: Array, y: Array, share: float, color: str) -> None:
    """Draw an arrow head on a curve, after a share of its visible length, unless the curve is too short."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    steps = np.hypot(np.diff(x) / (right - left), np.diff(y) / (top - bottom))
    length = np.concatenate([[0.0], np.cumsum(steps)])
    inside = (x.min() > left) & (x.max() < right)
    if not inside or length[-1] < 0.1:
        return
    index = int(np.searchsorted(length, share * length[-1]))
    start, end = (x[index - 1], y[index - 1]), (x[index], y[index])
    style.arrow(axes, start, end, color=color, lw=1.8, mutation_scale=15)
