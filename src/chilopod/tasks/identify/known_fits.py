"""Constants of the whole robot that meet the paper's base series, as ``chilopod identify twin`` has found them."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any


def known_fits() -> list[dict[str, Any]]:
    """Fits in ``twin_fits.json``, best first: ``constants`` (SI, by path), ``bends_rad``, ``residuals`` of each."""
    found: list[dict[str, Any]] = json.loads(
        files("chilopod.tasks.identify").joinpath("twin_fits.json").read_text(encoding="utf-8")
    )["fits"]
    return found
