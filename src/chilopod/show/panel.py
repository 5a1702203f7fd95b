"""Panels, which every figure consists of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import xarray as xr
from matplotlib.figure import Figure


@dataclass(frozen=True)
class Panel:
    """A figure with what is said about it.

    Attributes
    ----------
    name
        Name of its files.
    title
        Its heading.
    draw
        Makes the figure, in the narrow layout if told so; call it within :func:`chilopod.show.style.house_style`.
    alt
        Description of the picture for those who cannot see it.
    text
        Paragraphs beside it.
    data
        Data that are drawn.
    letter
        Before its heading, if it has one; A to D are those of the paper's figure.
    """

    name: str
    title: str
    draw: Callable[[bool], Figure]
    alt: str
    text: tuple[str, ...]
    data: xr.Dataset
    letter: str = ""
