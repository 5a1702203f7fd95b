"""Panels, which every figure consists of."""

from __future__ import annotations

from dataclasses import dataclass

import xarray as xr

from chilopod.show.style import Drawing


@dataclass(frozen=True)
class Panel:
    """A figure with the words about it."""

    name: str  # of its files
    title: str
    draw: Drawing  # within :func:`chilopod.show.style.house_style`
    alt: str  # description for readers who cannot see it
    text: tuple[str, ...]  # paragraphs beside it
    data: xr.Dataset  # that are drawn
    letter: str = ""  # before the title, if any
