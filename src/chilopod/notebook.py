"""How results show themselves in notebooks: HTML and SVG that need nothing but themselves.

What is drawn is in colours that are told apart on a white page as on a black one; text beside it has those of the page.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK = "#808080"
"""Colour of frames and of text in drawings."""

COLORS = ("#3a8fd0", "#e69f00", "#00a67a", "#d679a8", "#b07d4f", "#8a7fd0")
"""Colours of what is to be told apart."""

_SMALL = 11  # px, of text
_STYLE: Any = {
    **dict.fromkeys(("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color"), INK),
    "savefig.transparent": True,
    "legend.framealpha": 0.0,
    "svg.fonttype": "none",
    "svg.hashsalt": "chilopod",
}


def block(heading: str, *parts: str) -> str:
    """HTML that shows one result: its heading, which is escaped, and the parts, which are HTML."""
    return f'<div class="chilopod"><p><strong>{escape(heading)}</strong></p>{"".join(parts)}</div>'


def words(text: str) -> str:
    """A paragraph."""
    return f"<p>{escape(text)}</p>"


def table(head: Sequence[str], rows: Iterable[Sequence[object]], most: int = 20) -> str:
    """A table, of which at most so many rows are shown."""
    rows = list(rows)
    lines = ["".join(f"<td>{escape(str(cell))}</td>" for cell in row) for row in rows[:most]]
    if len(rows) > most:
        lines.append(f'<td colspan="{len(head)}">and {len(rows) - most} more</td>')
    top = "".join(f"<th>{escape(name)}</th>" for name in head)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{''.join(f'<tr>{line}</tr>' for line in lines)}</tbody></table>"


def folded(summary: str, inside: str) -> str:
    """HTML that is seen on demand."""
    return f"<details><summary>{escape(summary)}</summary>{inside}</details>"


def svg(width: float, height: float, inside: str, alt: str) -> str:
    """A drawing of this size (px), narrower where there is no room; ``alt`` says what is seen."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'role="img" aria-label="{escape(alt)}" style="max-width:100%;height:auto" font-family="sans-serif" '
        f'font-size="{_SMALL}" stroke-linejoin="round">{inside}</svg>'
    )


def label(x: float, y: float, text: str, anchor: str = "middle", turned: bool = False) -> str:
    """Text in a drawing, at a place in px."""
    turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{INK}"{turn}>{escape(text)}</text>'


def picture(draw: Callable[[Axes], object], alt: str, size: tuple[float, float] = (6.0, 3.6)) -> str:
    """SVG of what a function draws on axes of matplotlib, of a size (inches); ``alt`` says what is seen."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    drawn = io.StringIO()
    with rc_context(_STYLE):
        figure = Figure(figsize=size, layout="constrained")
        draw(figure.add_subplot())
        figure.savefig(drawn, format="svg", metadata=dict.fromkeys(("Creator", "Date", "Format", "Type")))
    _, tag, rest = drawn.getvalue().partition("<svg ")
    return f'{tag}role="img" aria-label="{escape(alt)}" {rest}'


def disc(x: float, y: float, radius: float, color: str, opacity: float = 1.0) -> str:
    """A disc in a drawing, in px."""
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" fill="{color}" fill-opacity="{opacity:g}"/>'
