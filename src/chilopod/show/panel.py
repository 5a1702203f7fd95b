"""Panels, which every figure consists of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import xarray as xr
from matplotlib.figure import Figure


@dataclass(frozen=True)
class Panel:
    """A figure with the words about it."""

    name: str  # of its files
    title: str
    draw: Callable[[bool], Figure]  # narrow if told so; within :func:`chilopod.show.style.house_style`
    alt: str  # description for readers who cannot see it
    text: tuple[str, ...]  # paragraphs beside it
    data: xr.Dataset  # that are drawn
    letter: str = ""  # before the title, if any
