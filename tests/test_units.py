"""Quantities: exact reading, exact round trips, and refusal of everything else."""

import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chilopod import units
from chilopod.errors import UnitError

STIFFNESS = "N*m/rad"


@pytest.mark.parametrize(
    ("text", "si_unit", "value"),
    [
        ("1.35 m", "m", 1.35), ("135cm", "m", 1.35), ("3 cm", "m", 0.03), ("8500 g", "kg", 8.5),
        ("310 ms", "s", 0.31), ("2 min", "s", 120.0), ("180 deg", "rad", math.pi), ("0.5 rev", "rad", math.pi),
        ("41 N*mm/deg", STIFFNESS, 41e-3 * 180 / math.pi), ("41 N·mm/°", STIFFNESS, 41e-3 * 180 / math.pi),
        ("41 N mm / deg", STIFFNESS, 41e-3 * 180 / math.pi), ("41 N*mm*deg^-1", STIFFNESS, 41e-3 * 180 / math.pi),
        ("2 N*m*s/rad", "N*m*s/rad", 2.0), ("2 N*m/(rad/s)", "N*m*s/rad", 2.0), ("3 kg*cm^2", "kg*m^2", 3e-4),
        ("3 kg*cm²", "kg*m^2", 3e-4), ("256.5 N*s/m", "N*s/m", 256.5), ("1 kgf", "N", 9.80665), ("2 Hz", "1/s", 2.0),
        ("-1.5e-3", "m", -1.5e-3), ("120", STIFFNESS, 120.0), (120, STIFFNESS, 120.0), (Fraction(1, 4), "m", 0.25),
        ("30%", "", 0.3), ("-2.5 %", "", -0.025), ("10 %/s", "1/s", 0.1),
    ],
)  # fmt: skip
def test_reads(text, si_unit, value):
    assert units.parse(text, si_unit) == pytest.approx(value, rel=2e-16)


def test_rounds_once():
    # Stepwise floating-point arithmetic misses some of these in the last place.
    exact = Fraction(31415926535897932384626433832795028841971, 10**40)
    for degrees in range(1, 361):
        assert units.parse(f"{degrees} deg", "rad") == float(degrees * exact / 180)
        assert units.parse(f"{degrees} N*mm/deg", STIFFNESS) == float(Fraction(degrees, 1000) * 180 / exact)


@pytest.mark.parametrize(
    ("text", "si_unit", "complaint"),
    [
        ("3 kg", "m", "is a mass; allowed: a length"),
        ("3 N*m", STIFFNESS, "is a torque; allowed: a torsional stiffness"),
        ("3 rad", "", "is an angle; allowed: a plain number"),
        ("3 Nmm/deg", STIFFNESS, "did you mean 'N*mm'"),
        ("3 meter", "m", "unknown unit 'meter'"),
        ("3 degg", "rad", "did you mean 'deg'"),
        ("3 turn", "rad", "unknown unit 'turn'; allowed: an angle"),
        ("3 m*", "m", "incomplete"),
        ("3 (m", "m", "incomplete"),
        ("3 m)", "m", "misplaced"),
        ("3 m^99", "m", "misplaced"),
        ("3 (m^9)^9", "m", "misplaced"),
        ("3,5 m", "m", "misplaced"),
        ("", "m", "must start with a finite number"),
        ("m", "m", "must start with a finite number"),
        ("nan", "m", "must start with a finite number"),
        ("inf m", "m", "must start with a finite number"),
        ("1e400 m", "m", "too large"),
        ("1e999999999999 m", "m", "exponent"),
        ("1" * 1000, "m", "too long"),
        (math.nan, "m", "must be a finite number"),
        (math.inf, "m", "must be a finite number"),
        (10**400, "m", "must be a finite number"),
        (True, "m", "must be a quantity"),
        (None, "m", "must be a quantity"),
        ([1.0], "m", "must be a quantity"),
        (1j, "m", "must be a quantity"),
    ],
)
def test_refuses(text, si_unit, complaint):
    with pytest.raises(UnitError) as caught:
        units.parse(text, si_unit)
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (41e-3 * 180 / math.pi, "N*mm/deg", "41 N*mm/deg"),
        (0.03, "cm", "3 cm"),
        (math.pi / 2, "deg", "90 deg"),
        (1e-30, "m", "1e-30 m"),
        (0.0, "m", "0 m"),
        (6.0, "", "6"),
    ],
)
def test_writes_the_shortest_text(value, unit, text):
    assert units.format(value, unit) == text


def test_writes_given_digits():
    assert units.format(1.0 / 3.0, "cm", digits=3) == "33.3 cm"
    assert units.format(144.0, "N*s/m", digits=2) == "140 N*s/m"
    assert units.format(1.44e7, "N*s/m", digits=2) == "1.4e+07 N*s/m"
    assert units.from_si(0.5, "mm") == 500.0
    assert math.isnan(units.from_si(math.nan, "N*mm/deg"))
    assert units.from_si(-math.inf, "N*mm/deg") == -math.inf


@given(
    st.floats(-1e300, 1e300),
    st.sampled_from([("m", "cm"), ("rad", "deg"), (STIFFNESS, "N*mm/deg"), ("s", "min"), ("N", "kgf"), ("", "")]),
)
def test_round_trip_is_exact(value, pair):
    si_unit, unit = pair
    assert units.parse(units.format(value, unit), si_unit) == value


@given(st.text() | st.from_regex(r"-?[0-9.e+-]{0,9} ?[a-zA-Z0-9()*/^ ·²]{0,20}", fullmatch=True))
def test_any_text_is_a_finite_number_or_refused(text):
    try:
        value = units.parse(text, STIFFNESS)
        message = ""
    except UnitError as error:
        value, message = 0.0, str(error)
    assert math.isfinite(value)
    assert message.isprintable()
