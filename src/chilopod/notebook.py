"""How results show themselves in notebooks: HTML and SVG that need nothing but themselves.

What is drawn is in colours that are told apart on a white page as on a black one; text beside it has those of the page.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

INK = "#808080"
"""Of frames and of text in drawings."""

COLORS = ("#3a8fd0", "#e69f00", "#00a67a", "#d679a8", "#b07d4f", "#8a7fd0")
"""Of what is to be told apart."""

_FRAME = (52.0, 10.0, 12.0, 40.0)  # px left of a plot, above it, right of it and below
_SMALL = 11  # px, of text
_MOST_POINTS = 300  # of a line


@dataclass(frozen=True)
class Line:
    """A line of a plot.

    Attributes
    ----------
    points
        x and y of each; where one is not finite the line is interrupted.
    color
        Of :data:`COLORS`.
    dotted
        Whether it is.
    """

    points: Sequence[tuple[float, float]]
    color: str = COLORS[0]
    dotted: bool = False


@dataclass(frozen=True)
class Mark:
    """A round mark of a plot.

    Attributes
    ----------
    x, y
        Of its middle.
    radius
        In units of x; 0 for a dot.
    color
        Of :data:`COLORS`.
    """

    x: float
    y: float
    radius: float = 0.0
    color: str = COLORS[2]


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


def plot(
    lines: Sequence[Line],
    marks: Sequence[Mark] = (),
    *,
    x: str,
    y: str,
    alt: str,
    size: tuple[float, float] = (420.0, 260.0),
    equal: bool = False,
) -> str:
    """Lines in a frame.

    Parameters
    ----------
    lines, marks
        What is drawn.
    x, y
        What the axes are, with the unit.
    alt
        What is seen.
    size
        Of the drawing, px, the frame's words included.
    equal
        Whether x and y have one scale, of which there may then be more than the lines need.

    Returns
    -------
    SVG. Without a finite point there is an empty frame.
    """
    points = [point for line in lines for point in line.points if all(map(math.isfinite, point))]
    for mark in marks:
        points += [(mark.x - mark.radius, mark.y - mark.radius), (mark.x + mark.radius, mark.y + mark.radius)]
    left, top, right, bottom = _FRAME
    wide, high = size[0] - left - right, size[1] - top - bottom
    x0, x1 = _range([point[0] for point in points])
    y0, y1 = _range([point[1] for point in points])
    if equal:
        scale = max((x1 - x0) / wide, (y1 - y0) / high)
        x0, x1 = _widened(x0, x1, scale * wide)
        y0, y1 = _widened(y0, y1, scale * high)

    def across(value: float) -> float:
        return left + (value - x0) / (x1 - x0) * wide

    def down(value: float) -> float:
        return top + (y1 - value) / (y1 - y0) * high

    parts = [f'<rect x="{left}" y="{top}" width="{wide}" height="{high}" fill="none" stroke="{INK}"/>']
    for value in _ticks(x0, x1):
        parts.append(_stroke([(across(value), top + high), (across(value), top + high + 4.0)]))
        parts.append(label(across(value), top + high + 16.0, f"{value:g}"))
    for value in _ticks(y0, y1):
        parts.append(_stroke([(left - 4.0, down(value)), (left, down(value))]))
        parts.append(label(left - 7.0, down(value) + 4.0, f"{value:g}", "end"))
    parts.append(label(left + 0.5 * wide, size[1] - 6.0, x))
    parts.append(label(12.0, top + 0.5 * high, y, turned=True))
    for line in lines:
        for piece in _pieces(line.points):
            placed = [(across(a), down(b)) for a, b in piece]
            parts.append(_stroke(placed, line.color, 1.8, line.dotted))
    for mark in marks:
        radius = mark.radius / (x1 - x0) * wide if mark.radius else 4.0
        parts.append(disc(across(mark.x), down(mark.y), radius, mark.color, 0.35 if mark.radius else 1.0))
    return svg(*size, "".join(parts), alt)


def disc(x: float, y: float, radius: float, color: str, opacity: float = 1.0) -> str:
    """A disc in a drawing, in px."""
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" fill="{color}" fill-opacity="{opacity:g}"/>'


def _stroke(points: Sequence[tuple[float, float]], color: str = INK, width: float = 1.0, dotted: bool = False) -> str:
    way = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dots = ' stroke-dasharray="2 4"' if dotted else ""
    return f'<polyline points="{way}" fill="none" stroke="{color}" stroke-width="{width:g}"{dots}/>'


def _pieces(points: Sequence[tuple[float, float]]) -> list[list[tuple[float, float]]]:
    """A line between its interruptions, with no more points than the eye needs."""
    every = max(1, math.ceil(len(points) / _MOST_POINTS))
    pieces: list[list[tuple[float, float]]] = [[]]
    for index, point in enumerate(points):
        if not all(map(math.isfinite, point)):
            pieces.append([])
        elif index % every == 0 or index == len(points) - 1:
            pieces[-1].append(point)
    return [piece for piece in pieces if len(piece) > 1]


def _range(values: Sequence[float]) -> tuple[float, float]:
    """What holds all values, and some room."""
    low, high = (min(values), max(values)) if values else (0.0, 1.0)
    # Of what is nearly one value no more is shown than its digits tell.
    room = max(0.04 * (high - low), 1e-6 * max(abs(low), abs(high))) or 0.5
    return low - room, high + room


def _widened(low: float, high: float, width: float) -> tuple[float, float]:
    middle = 0.5 * (low + high)
    return middle - 0.5 * width, middle + 0.5 * width


def _ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Round values within a range, not more than so many or one more."""
    raw = (high - low) / most
    decade = 10.0 ** math.floor(math.log10(raw))
    step = next(each * decade for each in (1.0, 2.0, 5.0, 10.0) if each * decade >= raw * (1.0 - 1e-9))
    return [round(index * step, 12) for index in range(math.ceil(low / step), math.floor(high / step) + 1)]
