"""Numbers and names as they stand in running text and on axes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import SupportsFloat

SPRING_UNIT = "N·mm/deg"

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


def number(value: SupportsFloat, digits: int = 3) -> str:
    """Number with some significant digits, trailing zeros included, and a true minus sign."""
    text = f"{float(value):#.{digits}g}".rstrip(".")
    return minus(text if "e" not in text else f"{float(value):.{digits - 1}e}")


def round_down(value: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is no larger than a positive number."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in (1, 2, 5) if step * power <= value * (1.0 + 1e-9))


def signed(value: float, digits: int = 0) -> str:
    """Number with its sign and some decimals."""
    return minus(f"{value:+.{digits}f}")


def minus(text: str) -> str:
    """Text with true minus signs."""
    return text.replace("-", "−")


def spring(value: SupportsFloat, digits: int = 4) -> str:
    """A spring constant with its unit."""
    return f"{number(value, digits)}\u00a0{SPRING_UNIT}"


def k(joint: int) -> str:
    """Name of a spring, counted from 1 at the front."""
    return "k" + str(joint).translate(_SUBSCRIPTS)


def typeset(text: str) -> str:
    """Text of the studies with proper signs for units, powers and springs, and no break between number and unit."""
    text = text.replace("*", "·").replace("k2-5", "k₂–k₅").replace(" deg", "°").replace("critical k1", "critical k₁")
    text = re.sub(
        r"(\d)e\+?(-?)0*(\d+)", lambda found: f"{found[1]}×10{(found[2] + found[3]).translate(_SUPERSCRIPTS)}", text
    )
    text = re.sub(r"(?<![\w.])-(?=\d)", "−", text)
    return re.sub(r"([\d⁰¹²³⁴⁵⁶⁷⁸⁹]) (?=(?:N·|mm|cm|s\b|rad/s|%))", "\\1\u00a0", text)


def spans(counts: Sequence[int]) -> str:
    """Whole numbers in rising order with runs drawn together: "4, 7 to 18 and 20"."""
    parts: list[str] = []
    for _, numbered in groupby(enumerate(counts), lambda each: each[1] - each[0]):
        run = [str(count) for _, count in numbered]
        parts += [f"{run[0]} to {run[-1]}"] if len(run) > 2 else run
    return listing(parts)


def listing(items: Iterable[str]) -> str:
    """Items joined by commas and a last "and"."""
    names = list(items)
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
