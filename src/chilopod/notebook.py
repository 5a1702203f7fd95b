"""Display of results: as lines of text, as a drawing, and in notebooks as HTML and SVG without external files.

Drawings use colours that are distinct on white and on black pages; text takes the colours of the page.
"""

from __future__ import annotations

import io
import itertools
import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from chilopod.errors import ParameterError
from chilopod.frozen import Short

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK = "#808080"
"""Colour of frames and of text in drawings."""

COLORS = ("#3a8fd0", "#e69f00", "#00a67a", "#d679a8", "#b07d4f", "#8a7fd0")
"""Colours of different series."""

_SMALL = 11  # px, of text
_WIDEST = 110  # characters of a line
_LINES = 15  # of a result
_STYLE: Any = {
    **dict.fromkeys(("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color"), INK),
    "savefig.transparent": True,
    "legend.framealpha": 0.0,
    "svg.fonttype": "none",
    "svg.hashsalt": "chilopod",
}


class Shown(Short):
    """Base of results that print as a heading and a few lines, and show the same in notebooks."""

    def _lines(self) -> list[str]:
        raise NotImplementedError

    def __str__(self) -> str:
        wrapped = (textwrap.wrap(line, _WIDEST, subsequent_indent="    ") for line in self._lines())
        lines = list(itertools.chain.from_iterable(wrapped))
        if len(lines) > _LINES:
            lines[_LINES - 1 :] = [f"  and {len(lines) - _LINES + 1} more lines"]
        return "\n".join(lines)

    def _picture(self) -> str:
        return ""

    def _repr_html_(self) -> str:
        heading, _, text = str(self).partition("\n")
        return block(heading, self._picture(), f"<pre>{escape(text)}</pre>")


class Summary(Shown):
    """Base of results whose summary is a title, a table with a head, and sentences above and below it."""

    @property
    def title(self) -> str:
        """Heading of the result."""
        raise NotImplementedError

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        """Lines of the sentences above, the table, and the sentences below."""
        raise NotImplementedError

    def lines(self) -> list[str]:
        """The whole summary as lines of text."""
        above, cells, below = self._content()
        return [self.title, *(f"  {line}" for line in (*above, *aligned(cells), *below))]

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the result on axes of matplotlib, those of a new figure by default, and return them."""
        raise NotImplementedError

    def _lines(self) -> list[str]:
        title, *lines = self.lines()
        return [f"{type(self).__name__}: {title}", *lines]

    def _picture(self) -> str:
        return picture(self.plot, self.title)

    def _repr_html_(self) -> str:
        above, cells, below = self._content()
        shown = table(cells[0], cells[1:]) if cells else ""
        return block(self.title, self._picture(), *map(words, above), shown, *map(words, below))


def aligned(cells: Iterable[Sequence[str]], most: int | None = None) -> list[str]:
    """Lines of a table with aligned columns, at most ``most`` rows and a count of the others."""
    cells = list(cells)
    widths = [max(map(len, column)) for column in zip(*cells[:most], strict=True)]
    lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in cells[:most]]
    return lines if most is None or len(cells) <= most else [*lines, f"and {len(cells) - most} more"]


def axes_for(axes: Axes | None) -> Axes:
    """Axes of matplotlib, by default those of a new figure."""
    from matplotlib.axes import Axes

    if axes is None:
        from matplotlib import pyplot

        return pyplot.figure(layout="constrained").add_subplot()
    if not isinstance(axes, Axes):
        raise ParameterError("must be axes to draw on", field="axes", value=axes, allowed="axes of matplotlib, or None")
    return axes


def tornado(axes: Axes | None, changes: Mapping[str, float], label: str, title: str) -> Axes:
    """Draw changes by their names as horizontal bars, largest on top, on axes of matplotlib or on new ones."""
    axes = axes_for(axes)
    order = sorted(changes, key=lambda name: abs(changes[name]) if math.isfinite(changes[name]) else 0.0)
    if not order:
        axes.text(0.5, 0.5, "no change", ha="center", transform=axes.transAxes)
    colors = ["C0" if changes[name] > 0.0 else "C1" for name in order]
    axes.barh(order, [changes[name] for name in order], color=colors)
    axes.axvline(0.0, color="C7", linewidth=0.8)
    axes.set(xlabel=label, title=title)
    return axes


def finite(value: float | None) -> float | None:
    """Number for JSON; None if it is not finite."""
    return float(value) if value is not None and math.isfinite(value) else None


def block(heading: str, *parts: str) -> str:
    """HTML of one result: its heading as plain text, then the parts as HTML."""
    return f'<div class="chilopod"><p><strong>{escape(heading)}</strong></p>{"".join(parts)}</div>'


def words(text: str) -> str:
    """A paragraph."""
    return f"<p>{escape(text)}</p>"


def table(head: Sequence[str], rows: Iterable[Sequence[object]], most: int = 20) -> str:
    """HTML of a table with a limited number of rows."""
    rows = list(rows)
    lines = ["".join(f"<td>{escape(str(cell))}</td>" for cell in row) for row in rows[:most]]
    if len(rows) > most:
        lines.append(f'<td colspan="{len(head)}">and {len(rows) - most} more</td>')
    top = "".join(f"<th>{escape(name)}</th>" for name in head)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{''.join(f'<tr>{line}</tr>' for line in lines)}</tbody></table>"


def folded(summary: str, inside: str) -> str:
    """HTML that unfolds on a click."""
    return f"<details><summary>{escape(summary)}</summary>{inside}</details>"


def svg(width: float, height: float, inside: str, alt: str) -> str:
    """SVG of this size (px), scaled down to narrower pages; ``alt`` describes it."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'role="img" aria-label="{escape(alt)}" style="max-width:100%;height:auto" font-family="sans-serif" '
        f'font-size="{_SMALL}" stroke-linejoin="round">{inside}</svg>'
    )


def label(x: float, y: float, text: str, anchor: str = "middle", turned: bool = False) -> str:
    """Text in a drawing, at a position in px."""
    turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{INK}"{turn}>{escape(text)}</text>'


def picture(draw: Callable[[Axes], object], alt: str, size: tuple[float, float] = (6.0, 3.6)) -> str:
    """SVG of a drawing on axes of matplotlib, of a size in inches; ``alt`` describes it."""
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


def check(answer: object, conditions: Mapping[str, Callable[[Any], object]]) -> None:
    """Check the answer to an exercise, and print whether it is right.

    Parameters
    ----------
    answer
        Answer; dots (``...``) stand for a missing one.
    conditions
        Conditions that the answer must meet, each by the sentence to print where it is not met. They are tried in this
        order.
    """
    if answer is ...:
        print("Not answered yet. Write your answer in place of the dots, and run the cell again.")
        return
    for sentence, holds in conditions.items():
        try:
            if holds(answer):
                continue
        except Exception as error:  # whatever an answer may be
            sentence = f"This answer cannot be checked: {error}."
        print(f"Not yet. {sentence}")
        return
    print("Right.")
