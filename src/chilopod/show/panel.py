"""Panels, which every figure consists of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import xarray as xr
from matplotlib.figure import Figure


@dataclass(frozen=True)
class Panel:
    """A figure with the words about it.

    Attributes
    ----------
    name, title, letter
        Name of its files, its heading, and the letter before that, if any.
    draw
        Function that draws it, in the narrow layout if told so; for use within
        :func:`chilopod.show.style.house_style`.
    alt, text
        Description for readers who cannot see it, and the paragraphs beside it.
    data
        Data that are drawn.
    """

    name: str
    title: str
    draw: Callable[[bool], Figure]
    alt: str
    text: tuple[str, ...]
    data: xr.Dataset
    letter: str = ""
