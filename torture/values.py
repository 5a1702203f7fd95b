"""Bad values of many kinds, good ones at the edge, and how a quantity reads to somebody who shares no code with us."""

from __future__ import annotations

import math
import re
from random import Random

NUMBERS = (
    *("0", "-0", "1", "-1", "2", "3.7", "1e-12", "1e-30", "1e-300", "5e-324", "1e5", "1e9", "1e12", "1e30", "1e300"),
    *(
        "1e308",
        "1e309",
        "1e99999",
        "-1e9",
        "nan",
        "inf",
        "-inf",
        "1_000",
        "0x10",
        "1e",
        "--1",
        "+-1",
        "1.2.3",
        "½",
        "１２",
    ),
    *("2147483648", "4294967296", "9223372036854775808", "9" * 50, "9" * 5000, "1" + "0" * 400, "0." + "0" * 400 + "1"),
)
UNITS = (
    *(
        "",
        "m",
        "mm",
        "kg",
        "g",
        "s",
        "ms",
        "min",
        "h",
        "deg",
        "rad",
        "rev",
        "N*m/rad",
        "N*mm/deg",
        "N*m*s/rad",
        "kg*m^2",
    ),
    *("N*s/m", "Hz", "1/s", "parsec", "N*m", "m^9", "m^99", "m/", "*m", "(m", "m)", "((((m))))", "m m", "%", "°", "µm"),
    *("N·mm/deg", "kg²", "sec", "M", "nm" * 60, "m/s/s/s", "\u202em", "m\n", "m\t"),
)
TEXTS = (
    *(
        "",
        " ",
        "abc",
        "-",
        "--",
        "---",
        "--help",
        "--no-such",
        "=",
        "a=b",
        "None",
        "null",
        "true",
        "[]",
        "{}",
        "[1, 2]",
    ),
    *(
        "a" * 300,
        "a" * 5000,
        "é",
        "日本",
        "\u202e",
        "\x1b[31mred",
        "a\nb",
        "a\tb",
        "a\rb",
        "\udcff",
        "%s%n",
        "{0}",
        "$HOME",
    ),
    *(
        "`id`",
        "'; drop",
        '"',
        "\\",
        "../..",
        "../../x.nc",
        ".",
        "..",
        "~",
        "*",
        "a/b/c.nc",
        "nosuch/x.toml",
        "x.nc/y.nc",
    ),
    *("json:loads", "json:JSONDecoder", "os:sep", "chilopod:nosuch", "nosuch:nosuch", ":", "a:b:c", "builtins:print"),
    *("tcp://127.0.0.1:1", "127.0.0.1:1", "http://", "file:///x", "1000000", "-7", "3.5", "1e9"),
    *("45 deg, 1.3 m", "45 deg", "1.3 m, 45 deg", ",", ",,", "1,2,3", "0 deg, 0 m", "nan deg, 1 m", "45 deg, -1 m"),
    *(
        "1e9 deg, 1e9 m",
        "45 deg, 1e-300 m",
        "2,0,0,0,0 deg",
        "2,0 deg",
        "2,0,0,0,0 m",
        "1e9 deg",
        "auto",
        "law",
        "planar",
    ),
    *("twin", "pitchfork", "hopf", "leg-yaw", "open-loop", "aoi2022", "aoi2022-planar", "springs.stiffness[0]"),
    *("springs.stiffness", "springs.stiffness[99]", "springs.stiffness[-1]", "springs.stiffness[ 0]", "body.modules"),
    *("gait.stance", "body.mass", "name", "provenance", "a.b.c", "mode", "curved", "." * 3000),
)
PLACES = (
    "folder",
    "file",
    "fifo",
    "dangling",
    "loop",
    "link",
    "empty",
    "/proc/version",
    "/proc/nosuch",
    "/sys",
    "/dev/null/x",
)
"""Made by :func:`arguments.furnish` in the folder of a case, but for those that nobody can write."""

GOOD = {
    "m": ("1.35 m", "135 cm", "1350 mm", "0.00135 km", "53 in"),
    "kg": ("8.5 kg", "8500 g", "18.7 lb"),
    "s": ("0.31 s", "310 ms", "0.005 min"),
    "deg": ("120 deg", "2.1 rad", "0.333 rev"),
    "N*m/rad": ("2 N*m/rad", "41 N*mm/deg", "0.04 N*m/deg", "400 gf*cm/deg"),
    "N*s/m": ("246.5 N*s/m", "0.25 N*s/mm", "246.5 kg/s"),
}
"""Right values, written in many ways."""

_SIZES = {
    **{"m": 1.0, "g": 1e-3, "s": 1.0, "rad": 1.0, "N": 1.0, "J": 1.0, "W": 1.0, "Hz": 1.0, "deg": math.pi / 180.0},
    **{"rev": 2.0 * math.pi, "min": 60.0, "h": 3600.0, "in": 0.0254, "lb": 0.45359237, "gf": 9.80665e-3},
}
_PREFIXES = {"": 1.0, "n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6}
_QUANTITY = re.compile(r"([+-]?\d+\.?\d*(?:[eE][+-]?\d{1,3})?)((?:[ */]*[A-Za-z]+(?:\^-?\d)?)*)")
_FACTOR = re.compile(r"([ */]*)([A-Za-z]+)(?:\^(-?\d))?")


def in_si(value: object) -> float | None:
    """A quantity in SI units, read plainly; None where this cannot."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value) if abs(value) < 1e300 else None
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        return None
    size = float(match[1])
    for before, name, power in _FACTOR.findall(match[2]):
        known = [
            scale * _SIZES[name[len(p) :]]
            for p, scale in _PREFIXES.items()
            if name[len(p) :] in _SIZES and name.startswith(p)
        ]
        if name in _SIZES:
            known = [_SIZES[name]]
        if len(known) != 1:
            return None
        size *= known[0] ** ((-1 if "/" in before else 1) * int(power or 1))
    return size


def any_text(chance: Random) -> str:
    """Anything at all."""
    how = chance.randrange(6)
    if how < 2:
        return chance.choice(TEXTS)
    if how < 4:
        return f"{chance.choice(NUMBERS)} {chance.choice(UNITS)}".strip() if how == 2 else chance.choice(NUMBERS)
    if how == 4:
        return chance.choice(chance.choice(tuple(GOOD.values())))
    letters = "".join(
        chr(chance.choice((chance.randrange(33, 127), chance.randrange(161, 0x2FFF))))
        for _ in range(chance.randrange(1, 12))
    )
    return letters.lstrip("/.-~") or "x"
