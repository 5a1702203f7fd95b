"""Reading and writing quantities: a number and a product of units.

The table of units is closed and small, so this short module replaces a dependency whose import alone would cost 0.3 s
of every command. Three design decisions:

- An angle is a dimension of its own. A torsional stiffness is in N*m/rad, and "3 N*m" is refused for one.
- Arithmetic is rational, with pi to 50 digits, and rounded once at the end: "41 N*mm/deg" is the double nearest to
  0.041 * 180/pi, and `format` finds the shortest text that `parse` reads back to the same bits.
- Text may be hostile: length, exponents and nesting are bounded before anything is computed.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from functools import lru_cache
from numbers import Real
from typing import Final

from chilopod.errors import UnitError, nearest_name

_LONGEST_TEXT: Final = 100
_LONGEST_EXPONENT: Final = 4
_PI: Final = Fraction(31415926535897932384626433832795028841971693993751, 10**49)
_NUMBER: Final = re.compile(r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE]([+-]?[0-9]+))?)(?![0-9.])\s*(.*)", re.DOTALL)
# An operator or bracket, or a name with its power. Powers have one digit and belong to names, never to brackets, so no
# text can make a number too big to compute with.
_TOKEN: Final = re.compile(r"\s*(?:([*/()])|([A-Za-z]+|1|%)(?:\s*(?:\^|\*\*)\s*([+-]?[0-9]))?(?![0-9]))\s*")
# Typographic forms that are common in papers.
_PLAIN: Final = str.maketrans({"·": "*", "⋅": "*", "×": "*", "µ": "u", "μ": "u", "°": "deg", "²": "^2", "³": "^3"})


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit as an exact multiple of its SI unit.

    Attributes
    ----------
    factor
        Rational part of the size in SI units.
    pi_power
        The size is `factor` * pi**`pi_power`.
    dimension
        Exponents of (length, mass, time, angle).
    """

    factor: Fraction
    pi_power: int
    dimension: tuple[int, int, int, int]

    def times(self, other: Unit, power: int = 1) -> Unit:
        """Return this unit times `other` to an integer `power`."""
        length, mass, time, angle = (a + power * b for a, b in zip(self.dimension, other.dimension, strict=True))
        return Unit(
            self.factor * other.factor**power, self.pi_power + power * other.pi_power, (length, mass, time, angle)
        )

    @property
    def size(self) -> Fraction:
        """The size in SI units, exact or, where pi is in it, to 50 digits."""
        return self.factor * _PI**self.pi_power


_ONE: Final = Unit(Fraction(1), 0, (0, 0, 0, 0))
_UNITS: Final = {
    "%": Unit(Fraction(1, 100), 0, (0, 0, 0, 0)),
    "m": Unit(Fraction(1), 0, (1, 0, 0, 0)),
    "g": Unit(Fraction(1, 1000), 0, (0, 1, 0, 0)),
    "s": Unit(Fraction(1), 0, (0, 0, 1, 0)),
    "rad": Unit(Fraction(1), 0, (0, 0, 0, 1)),
    "N": Unit(Fraction(1), 0, (1, 1, -2, 0)),
    "J": Unit(Fraction(1), 0, (2, 1, -2, 0)),
    "W": Unit(Fraction(1), 0, (2, 1, -3, 0)),
    "Hz": Unit(Fraction(1), 0, (0, 0, -1, 0)),
    "deg": Unit(Fraction(1, 180), 1, (0, 0, 0, 1)),
    "rev": Unit(Fraction(2), 1, (0, 0, 0, 1)),
    "min": Unit(Fraction(60), 0, (0, 0, 1, 0)),
    "h": Unit(Fraction(3600), 0, (0, 0, 1, 0)),
    "in": Unit(Fraction(254, 10000), 0, (1, 0, 0, 0)),
    "lb": Unit(Fraction(45359237, 10**8), 0, (0, 1, 0, 0)),
    "gf": Unit(Fraction(980665, 10**8), 0, (1, 1, -2, 0)),
}
_PREFIXED: Final = ("m", "g", "s", "rad", "N", "J", "W", "Hz", "gf")
_PREFIXES: Final = {
    "n": Fraction(1, 10**9),
    "u": Fraction(1, 10**6),
    "m": Fraction(1, 1000),
    "c": Fraction(1, 100),
    "k": Fraction(1000),
    "M": Fraction(10**6),
}
_SPELT_OUT: Final = {"degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad", "sec": "s", "kgs": "kg"}
# Named dimensions, each with an example for the error message.
_KINDS: Final = {
    (0, 0, 0, 0): "a plain number",
    (1, 0, 0, 0): "a length such as m or cm",
    (0, 1, 0, 0): "a mass such as kg or g",
    (0, 0, 1, 0): "a time such as s or ms",
    (0, 0, 0, 1): "an angle such as rad or deg",
    (2, 1, -2, -1): "a torsional stiffness such as N*m/rad or N*mm/deg",
    (2, 1, -1, -1): "a torsional damping such as N*m*s/rad",
    (2, 1, -2, 0): "a torque such as N*m",
    (1, 1, -2, 0): "a force such as N",
    (2, 1, 0, 0): "a moment of inertia such as kg*m^2",
    (0, 1, -1, 0): "a friction coefficient such as N*s/m",
    (0, 0, -1, 0): "a rate such as 1/s or Hz",
    (0, 0, -1, 1): "an angular rate such as rad/s or deg/s",
    (1, 0, -1, 0): "a speed such as m/s",
}


@lru_cache(maxsize=256)
def unit(text: str) -> Unit:
    """Read a product of units such as ``N*mm/deg``, ``kg*m^2`` or ``N*m/(rad/s)``.

    ``*``, a middle dot or a space multiplies, ``/`` divides by the next unit only, ``^`` or ``**`` raises to a power.
    The empty text is the unit of a plain number. UnitError if a name is unknown or the text is no product of units.
    """
    if len(text) > _LONGEST_TEXT:
        raise UnitError("too long for a unit", value=text, allowed=f"up to {_LONGEST_TEXT} characters")
    plain = text.strip().translate(_PLAIN)
    result, position = _ONE, 0
    # Whether each open bracket stands above or below the line; the first entry is the whole text.
    brackets = [1]
    sign, incomplete = 1, bool(plain)
    while position < len(plain):
        match = _TOKEN.match(plain, position)
        if match is None:
            raise UnitError(f"{plain[position]!r} is misplaced in the unit", value=text)
        operator, name, power = match.groups()
        if (operator in ("*", "/", ")") and incomplete) or (operator == ")" and len(brackets) == 1):
            raise UnitError(f"{operator!r} is misplaced in the unit", value=text)
        if operator == "(":
            brackets.append(brackets[-1] * sign)
        elif operator == ")":
            brackets.pop()
        elif name:
            result = result.times(_named(name, text), brackets[-1] * sign * int(power or 1))
        sign = -1 if operator == "/" else 1
        incomplete = operator is not None and operator != ")"
        position = match.end()
    if incomplete or len(brackets) > 1:
        raise UnitError("the unit is incomplete", value=text)
    return result


def parse(value: object, si_unit: str) -> float:
    """Read a quantity and return it in SI units.

    Parameters
    ----------
    value
        A number, taken as SI (radians for angles), or text: a number and, unless it is SI, its unit.
    si_unit
        A unit of the required dimension, such as ``N*m/rad``; only its dimension counts.

    Returns
    -------
    float
        The double nearest to the quantity in SI units; UnitError if `value` is neither, its unit is unknown or of
        another dimension, or it is not finite.
    """
    kind = kind_of(si_unit)
    if isinstance(value, Real) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise UnitError("must be a finite number", value=value, allowed=kind)
        return number
    if not isinstance(value, str):
        raise UnitError("must be a quantity", value=value, allowed=f"{kind}, as a number or as text with its unit")
    if len(value) > _LONGEST_TEXT:
        raise UnitError("too long for a quantity", value=value, allowed=f"up to {_LONGEST_TEXT} characters")
    match = _NUMBER.fullmatch(value)
    if match is None:
        raise UnitError("must start with a finite number", value=value, allowed=kind)
    digits, exponent, unit_text = match.groups()
    if exponent and len(exponent) > _LONGEST_EXPONENT:
        raise UnitError("the exponent is out of range", value=value, allowed=kind)
    size = Fraction(1)
    if unit_text:
        try:
            given = unit(unit_text)
        except UnitError as error:
            nearest = error.nearest
            if nearest and unit_text.isalpha() and unit(nearest).dimension != unit(si_unit).dimension:
                nearest = None
            raise UnitError(error.problem, value=value, allowed=kind, nearest=nearest) from None
        if given.dimension != unit(si_unit).dimension:
            raise UnitError(f"is {kind_of(unit_text).partition(' such as ')[0]}", value=value, allowed=kind)
        size = given.size
    number = _nearest_double(Fraction(digits) * size)
    if not math.isfinite(number):
        raise UnitError("too large for a finite number", value=value, allowed=kind)
    return number


def unit_in(value: str) -> str:
    """Text of the unit of a quantity that :func:`parse` reads; empty if it has none."""
    match = _NUMBER.fullmatch(value)
    return match[3].strip() if match else ""


def from_si(value: float, unit_text: str) -> float:
    """Return `value`, in SI units, in the unit `unit_text` instead."""
    size = unit(unit_text).size
    # An unknown or infinite number is so in every unit.
    return value if size == 1 or not math.isfinite(value) else float(Fraction(value) / size)


def format(value: float, unit_text: str, digits: int | None = None) -> str:
    """Write a quantity given in SI units in another unit, such as ``41 N*mm/deg``.

    Parameters
    ----------
    value
        The quantity in SI units, finite.
    unit_text
        The unit to write it in; empty for a plain number.
    digits
        Significant digits; by default the fewest that `parse` reads back to exactly the same double.
    """
    if not math.isfinite(value):
        raise UnitError("must be a finite number", value=value)
    if digits is not None:
        number = f"{float(f'{from_si(value, unit_text):.{digits}g}'):.{max(digits, 6)}g}"  # 100 of one digit, not 1e+02
    elif value == 0.0:
        number = "0"
    else:
        number = _shortest(value, unit_text)
    return f"{number} {unit_text}" if unit_text else number


@lru_cache(maxsize=4096)
def _shortest(value: float, unit_text: str) -> str:
    size = unit(unit_text).size
    exact = Fraction(value) / size
    # 17 digits tell any two doubles apart in one unit; after a change of unit one more always does.
    for digits in range(1, 19):
        context = Context(prec=digits)
        decimal = context.divide(Decimal(exact.numerator), Decimal(exact.denominator)).normalize()
        if _nearest_double(Fraction(decimal) * size) == value:
            break
    return f"{decimal:f}" if -6 <= decimal.adjusted() < 16 else f"{decimal}".lower()


def _nearest_double(number: Fraction) -> float:
    try:
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf


def _named(name: str, text: str) -> Unit:
    name = _SPELT_OUT.get(name, name)
    if name == "1":
        return _ONE
    if name in _UNITS:
        return _UNITS[name]
    prefix, base = name[0], name[1:]
    if prefix in _PREFIXES and base in _PREFIXED:
        scaled = _UNITS[base]
        return Unit(scaled.factor * _PREFIXES[prefix], scaled.pi_power, scaled.dimension)
    known = [*_UNITS, *(p + u for u in _PREFIXED for p in _PREFIXES), "N*mm", "N*m"]
    raise UnitError(f"unknown unit {name!r}", value=text, nearest=nearest_name(name, known))


def kind_of(unit_text: str) -> str:
    """Words for the quantities of a unit, such as ``a length such as m or cm``."""
    dimension = unit(unit_text).dimension
    if dimension in _KINDS:
        return _KINDS[dimension]
    names = zip(("m", "kg", "s", "rad"), dimension, strict=True)
    powers = (name if power == 1 else f"{name}^{power}" for name, power in names if power)
    return f"of dimension {'*'.join(powers)}"
