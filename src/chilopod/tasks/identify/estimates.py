"""Constants that data give, how well these know them, and what of them they leave open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chilopod import units
from chilopod.frozen import Array
from chilopod.notebook import Summary
from chilopod.robot import Robot
from chilopod.tasks.identify.free import FreeConstants

CONFIDENCE = 0.9
"""Level of all intervals of constants."""

_OPEN = 0.4  # half of an interval, over the range, that leaves a constant open; where all are as likely it is 0.45
_AT = 1e-9  # distance from the end of a range that counts as none, over the range
_SMALL = 0.02  # change in a combination that is not said, over the largest


@dataclass(frozen=True)
class Estimates:
    """Estimates of free constants.

    Attributes
    ----------
    given, free
        Robot with the constants that are not free, and the free ones with their ranges.
    values, ends
        Best value of each constant, shape (constants,), and ends of its 90 % interval, shape (constants, 2), SI, NaN
        where none is found.
    spread
        Covariance of the constants, SI, for half of a 90 % interval in place of a standard deviation, shape (constants,
        constants); NaN where it is not known.
    remark
        Words that the provenance of each constant ends with.
    """

    given: Robot
    free: FreeConstants
    values: Array
    ends: Array
    spread: Array
    remark: str = ""

    @property
    def best(self) -> Robot:
        """The robot with the best values."""
        return self.free.robot_with(self.given, self.values)

    def identified(self, source: str) -> Robot:
        """The same, with the intervals as provenance."""
        best, known = self.best, self.as_json()["constants"].items()
        texts = {path: f"identified from {source}; 90 %: {each['interval_text']}{self.remark}" for path, each in known}
        return best.with_(name="identified", provenance={**best.provenance, **texts})

    def as_json(self) -> dict[str, Any]:
        """Constants with their intervals, correlations, and combinations that are independent: relative changes by half
        of the 90 % interval along each, best known first, and whether the data leave it open."""
        half, paths = np.sqrt(np.diag(self.spread)), self.free.paths
        found: dict[str, Any] = {path: self._constant(at, self.ends[at]) for at, path in enumerate(paths)}
        found = {"constants": found, "correlations": None, "combinations": []}
        if np.isfinite(self.spread).all():
            found["correlations"] = (self.spread / np.maximum(np.outer(half, half), 1e-300)).tolist()
            widths = np.ptp(self.free.limits(self.values), axis=1)
            scale = np.where(self.values == 0.0, widths, np.abs(self.values))
            squares, directions = np.linalg.eigh(self.spread / np.outer(scale, scale))
            signs = np.where(directions.sum(axis=0) < 0.0, -1.0, 1.0)
            for change in (signs * np.sqrt(np.abs(squares)) * directions).T:
                is_open = bool((np.abs(change) * scale > _OPEN * widths).any())
                found["combinations"].append(
                    {"changes": dict(zip(paths, change.tolist(), strict=True)), "open": is_open}
                )
        return found

    def _constant(self, at: int, ends: Array) -> dict[str, Any]:
        value, known = float(self.values[at]), ends.tolist() if np.isfinite(ends).all() else None
        found = {"value_si": value, "text": self._text(at, value, ends), "interval_si": known}
        return {**found, "interval_text": self.between(at, ends) or "none found"}

    def between(self, at: int, ends: Array) -> str:
        """Range of a constant in words, and whether the data or the search end it; nothing if it is NaN."""
        (low, high), half = self.free.limits(self.values)[at], float(np.sqrt(self.spread[at, at]))
        if not np.isfinite(ends).all():
            return ""
        remark = " (cut by the range searched)" if min(ends[0] - low, high - ends[1]) <= _AT * (high - low) else ""
        remark = " (left open by the data)" if half > _OPEN * (high - low) else remark
        return " to ".join(self._text(at, end, ends) for end in ends.tolist()) + remark

    def _text(self, at: int, value: float, ends: Array) -> str:
        """A value of a constant, with two digits of half of a range."""
        half = 0.5 * float(np.ptp(ends)) or np.nan
        digits = 2 + int(np.clip(np.ceil(np.log10(abs(value) / half)), 0, 6)) if value and np.isfinite(half) else 4
        return units.format(value, self.given.unit_of(self.free.paths[at]), digits)


class Identified(Summary):
    """Base of the results of an identification: a title, a table of the constants, and what the data leave open."""

    if TYPE_CHECKING:  # at run time it would be the default of a field

        @property
        def estimates(self) -> Estimates:
            """The constants with their intervals."""

    @property
    def best(self) -> Robot:
        """The robot with the best constants."""
        return self.estimates.best

    def as_json(self) -> dict[str, Any]:
        """Constants with intervals, correlations and combinations, and more numbers."""
        return self.estimates.as_json()

    def _columns(self) -> dict[str, list[str]]:
        """More columns of the table, by their heads."""
        return {}

    def _remarks(self) -> list[str]:
        """Sentences about this identification."""
        return []

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        found, more = self.estimates.as_json(), self._columns()
        cells: list[Sequence[str]] = [("constant", "best", f"{CONFIDENCE:.0%} interval", *more)]
        for (path, each), *texts in zip(found["constants"].items(), *more.values(), strict=True):
            cells.append((path, each["text"], each["interval_text"], *texts))
        said = [f"independent combinations, by half of their {CONFIDENCE:.0%} interval:"] * bool(found["combinations"])
        for each in found["combinations"]:
            least = _SMALL * max(map(abs, each["changes"].values()))
            shown = [(path, x, ".2g" if abs(x) < 1.0 else ".0f") for path, x in each["changes"].items()]
            texts = [f"{path} {100.0 * x:+{digits}} %" for path, x, digits in shown if abs(x) >= least]
            said.append(f"  {', '.join(texts)}{' (left open)' if each['open'] else ''}")
        return [], cells, [*said, *self._remarks()]
