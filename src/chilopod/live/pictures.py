"""Picture of a walk from above, for browsers without WebGL."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from textwrap import wrap

import numpy as np

from chilopod.live.body import Placed
from chilopod.show.style import SCENE

_WIDTH, _HEIGHT = 800, 560  # px
_LINE = 18  # px of a line of text


def from_above(placed: Mapping[str, Placed], length: float, words: str) -> bytes:
    """SVG of a robot's parts with a text below; length of the robot in m."""
    zoom, middle = 0.8 * _WIDTH / (1.6 * length), placed["box"].centres[:, :2].mean(axis=0)
    parts = []
    for kind, color in (("box", SCENE["body"]), ("ball", SCENE["ink"])):
        here = placed[kind]
        for index, ((x, y, _), (w, _, _, z), (along, across, _)) in enumerate(
            zip(here.centres, here.turns, here.scales, strict=True)
        ):
            place = f"{_WIDTH / 2 + zoom * (x - middle[0]):.1f} {0.4 * _HEIGHT - zoom * (y - middle[1]):.1f}"
            turn, a, b = -np.rad2deg(2.0 * np.arctan2(z, w)), zoom * along, zoom * across
            fill = SCENE["edge"] if kind == "box" and index == 0 else color
            shape = f'x="{-a / 2:.1f}" y="{-b / 2:.1f}" width="{a:.1f}" height="{b:.1f}" rx="{b / 4:.1f}"'
            parts.append(f'<rect {shape} fill="{fill}" transform="translate({place}) rotate({turn:.1f})"/>')
    lines = [line for paragraph in words.split("\n") for line in wrap(paragraph, 96)]
    for number, line in enumerate(lines):
        y = _HEIGHT - _LINE * (len(lines) - number)
        parts.append(f'<text x="16" y="{y}" font-family="sans-serif" font-size="15">{escape(line)}</text>')
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}">'
    return f'{head}<rect width="100%" height="100%" fill="white"/>{"".join(parts)}</svg>'.encode()
