"""One look for all figures: colours, type, sizes, and the encoding of figures."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from typing import Any, Concatenate, Final, Literal, ParamSpec

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.style import context as styled
from numpy.typing import NDArray

P = ParamSpec("P")
Drawing = Callable[[bool], Figure]  # narrow if told so

# Okabe and Ito (2008), told apart with every common colour vision; its yellow is too pale on white.
BLACK: Final = "#1a1a1a"
ORANGE: Final = "#e69f00"
SKY: Final = "#56b4e9"
GREEN: Final = "#009e73"
BLUE: Final = "#0072b2"
VERMILLION: Final = "#d55e00"
PURPLE: Final = "#cc79a7"
GREY: Final = "#767676"
PALE: Final = "#e8e8e8"

CURVES: Final = (BLUE, GREEN, PURPLE, ORANGE, SKY, GREY)
"""Colours of curves without a meaning of their own; :data:`VERMILLION` marks the loss of stability."""

SCENE: Final = {
    "ink": BLACK,
    "grid": "#d4d4d4",
    "body": SKY,
    "edge": BLUE,
    "air": GREY,
    "path": ORANGE,
    "target": GREEN,
    "spring": PURPLE,
}
"""Colours of films, replays and live pages: module 1 has that of edges."""

THIN: Final = 0.3
"""Width of the softest spring in pictures, relative to that of the stiffest."""

SMALL: Final = 9.0
"""Size of the smallest text, pt."""

WIDE: Final = 9.0
NARROW: Final = 3.75
"""Widths of the two layouts, inches: a page on a screen or on paper, and a phone."""

_RC: Final[Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": BLACK,
    "axes.labelcolor": BLACK,
    "axes.axisbelow": True,
    "text.color": BLACK,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "legend.fontsize": SMALL,
    "legend.frameon": False,
    "lines.linewidth": 1.8,
    "grid.color": PALE,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "svg.fonttype": "path",  # looks the same where the font is not installed
}


def springs(shares: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Widths (...), relative to that of the stiffest, and colours (..., 3) of springs in pictures: thin and light when
    soft. Shares are stiffnesses relative to the stiffest one, shape (...), cut at 1."""
    shares = np.clip(np.nan_to_num(shares), 0.0, 1.0)
    color = np.array(to_rgb(SCENE["spring"]))
    return THIN + (1.0 - THIN) * shares, 1.0 + (THIN + (1.0 - THIN) * shares)[..., None] * (color - 1.0)


@dataclass(frozen=True)
class Layout:
    """Axes of a figure: mosaic such as ``"AB;CC"``, height in inches, and relative heights and widths of rows and
    columns, equal if empty."""

    mosaic: str
    height: float
    heights: tuple[float, ...] = ()
    widths: tuple[float, ...] = ()


def figure(wide: Layout, narrow: Layout, is_narrow: bool) -> tuple[Figure, dict[str, Axes]]:
    """An empty figure and its axes by letter, in one of two layouts."""
    layout = narrow if is_narrow else wide
    drawn = Figure(figsize=(NARROW if is_narrow else WIDE, layout.height), layout="constrained")
    drawn.get_layout_engine().set(w_pad=0.08, h_pad=0.08, wspace=0.02, hspace=0.02)  # type: ignore[union-attr, call-arg]
    axes = drawn.subplot_mosaic(layout.mosaic, height_ratios=layout.heights or None, width_ratios=layout.widths or None)
    return drawn, axes


class Mosaic(dict[str, Axes]):
    """Axes of a figure by letter."""

    def __init__(self, wide: Layout, narrow: Layout, is_narrow: bool) -> None:
        self.figure, axes = figure(wide, narrow, is_narrow)
        self.narrow = is_narrow
        super().__init__(axes)

    def legend_below(self, letter: str, columns: int, narrow: int = 1, **look: Any) -> None:
        """Legend of some axes below the whole figure, with so many columns in each layout."""
        handles, count = self[letter].get_legend_handles_labels(), narrow if self.narrow else columns
        self.figure.legend(*handles, loc="outside lower center", ncols=count, **look)


def in_layouts(
    wide: Layout, narrow: Layout
) -> Callable[[Callable[Concatenate[Mosaic, P], None]], Callable[P, Drawing]]:
    """Decorator of a function that draws on the axes of a figure: with its other arguments, the figure in a layout."""

    def decorated(draw: Callable[Concatenate[Mosaic, P], None]) -> Callable[P, Drawing]:
        @wraps(draw)
        def of(*args: P.args, **named: P.kwargs) -> Drawing:
            def drawn(is_narrow: bool) -> Figure:
                axes = Mosaic(wide, narrow, is_narrow)
                draw(axes, *args, **named)
                return axes.figure

            return drawn

        return of

    return decorated


@contextmanager
def house_style() -> Iterator[None]:
    """Context in which figures look alike under any settings of the user's matplotlib."""
    with styled("default"):
        mpl.rcParams.update(_RC)
        yield


def svg(drawn: Figure, name: str) -> bytes:
    """The figure as SVG, the same bytes every time."""
    with mpl.rc_context({"svg.hashsalt": name}):
        return _saved(drawn, "svg", {"Date": None, "Creator": None})


def png(drawn: Figure, dpi: float = 160) -> bytes:
    """The figure as PNG, the same bytes every time."""
    return _saved(drawn, "png", {"Software": None}, dpi=dpi)


def _saved(drawn: Figure, kind: str, metadata: dict[str, None], dpi: float = 100) -> bytes:
    engine = drawn.get_layout_engine()
    if engine is not None:
        # Once laid out, it stays so: everything is in the same place in every format, and matplotlib draws once what it
        # would else draw twice.
        engine.execute(drawn)
        drawn.set_layout_engine(None)
    stream = io.BytesIO()
    drawn.savefig(stream, format=kind, metadata=metadata, dpi=dpi)
    return stream.getvalue()


def bare(axes: Axes) -> None:
    """Turn axes into a drawing: equal scales, no frame, at the left of its space, below its title."""
    axes.set_aspect("equal", anchor="W")
    axes.axis("off")


def finish(axes: Axes, grid: Literal["both", "x", "y"] = "both", legend: Any = None, **look: Any) -> None:
    """Labels, title and limits of axes, lines to read values by, and a legend if a place for it is given."""
    axes.set(**look)
    axes.grid(True, axis=grid)
    if legend:
        axes.legend(loc=legend)


def note(axes: Axes, text: str, at: tuple[float, float], away: tuple[float, float], **look: Any) -> None:
    """Small text beside a point, at a distance in printer's points; `look` as for an annotation."""
    axes.annotate(text, at, away, textcoords="offset points", fontsize=SMALL, **look)


def arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], **look: Any) -> None:
    """An arrow from a point to another; `look` as for an arrow's patch."""
    axes.annotate("", end, start, zorder=7, arrowprops={"arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0, **look})


def joint_styles(count: int) -> list[tuple[Any, str]]:
    """Colour and marker of every joint, front to rear: all different, also of more joints than there are colours to
    tell apart easily."""
    colors: list[Any] = [BLACK, *CURVES]
    if count > len(colors):
        colors = [mpl.colormaps["viridis"](index / count) for index in range(count)]
    return [(color, "os^vD"[index % 5]) for index, color in enumerate(colors[:count])]
