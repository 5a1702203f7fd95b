"""A map of the straight walk: one picture beside the other, and one legend."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from chilopod.analysis import StabilityMap
from chilopod.analysis.map_picture import draw as draw_on
from chilopod.analysis.map_picture import keys

_WIDTH, _HEIGHT = 5.2, 4.6  # inches, of one picture
_KEYS_IN_ROW = 4


def draw(found: StabilityMap, shown: Sequence[str]) -> Figure:
    """Pictures of a map by their names, see :meth:`StabilityMap.plot`."""
    figure = Figure(figsize=(_WIDTH * len(shown), _HEIGHT), layout="constrained")
    axes = figure.subplots(1, len(shown), squeeze=False)[0]
    for each, name in zip(axes, shown, strict=True):
        draw_on(found, each, name)
    columns = _KEYS_IN_ROW if len(shown) > 1 else _KEYS_IN_ROW // 2
    figure.legend(handles=keys(found, axes[0]), loc="outside lower center", ncols=columns)
    return figure
