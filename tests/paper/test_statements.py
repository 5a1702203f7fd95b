"""What is asked of numbers: a number just inside agrees, one just outside does not."""

import json

import numpy as np
import pytest

from chilopod.paper import printed, statements
from chilopod.paper.printed import Band
from chilopod.paper.table import (
    Kind,
    OfPlanar,
    OfTwin,
    Result,
    Statement,
    Verdict,
    at_once,
    estimated,
    of_twin,
    robot_rows,
)
from chilopod.statistics import Estimate

MEASURED = [each for each in statements.ORDER if isinstance(each.said, Band)]


@pytest.mark.parametrize("statement", MEASURED, ids=lambda each: each.quantity)
def test_every_measured_statement_on_both_sides(statement):
    low, high = statement.said.low, statement.said.high
    for value, verdict in ((low, "outside"), (high, "outside"), (0.5 * (low + high), "within")):
        beyond = value + (1e-6 * (value - 0.5 * (low + high)))
        (row,) = robot_rows([of_twin(statement, Result("", beyond, 0.0))], ())
        assert row.verdict == verdict
    for value in (low, high):
        inside = value - 1e-6 * (value - 0.5 * (low + high))
        assert [row.verdict for row in robot_rows([of_twin(statement, Result("", inside, 0.0))], ())] == ["within"]
        (row,) = robot_rows([estimated(statement, Estimate(inside, high - low, 9.0, 10), "")], ())
        assert row.verdict == "undecided"
        assert row.needs.endswith(" to decide")


def test_tolerances_are_those_that_the_rows_name():
    """What the table says is asked is what is asked."""
    for each in MEASURED:
        part, percent, _ = each.said.condition.partition(" %")
        if percent and part.isdigit():
            wanted = each.said.middle if not each.said.words.startswith(("almost", "no ")) else 1.0
            assert each.said.high == pytest.approx(wanted * (1.0 + float(part) / 100.0)), each.quantity


def test_a_sentence_counts_what_chance_decides_among_all_comparisons():
    said = statements.RADII[21.0]
    far, near = (estimated(said, Estimate(value, 0.04, 9.0, 10), "m") for value in (1.5, 1.07))
    rows = robot_rows([far, near, near], ())
    assert [row.verdict for row in rows] == ["outside"] * 3
    words = at_once(rows)
    assert words.startswith("3 verdicts rest on trials that scatter")
    assert "chance would decide 0.2 of them. 3 are decided, 1 with a chance of 5 % of any error among all" in words
    assert at_once([]) == ""


def test_statements_are_told_apart():
    assert len({each.quantity for each in statements.ORDER}) == len(statements.ORDER)
    assert len(set(statements.ORDER)) == len(statements.ORDER)


def test_lines_stand_in_the_order_of_the_statements_whoever_found_them_first():
    first, second = statements.ONSET, statements.UNIFORM
    other = Statement("one of a new section", printed.Said("1", "2"), Kind.CHECKED)
    found = [
        OfTwin(other, Result("3"), Verdict.WITHIN),
        OfPlanar(second, Result("6.58")),
        OfTwin(first, Result("33"), Verdict.WITHIN),
        OfPlanar(first, Result("12")),
    ]
    rows = robot_rows(found, statements.ORDER)
    assert [(row.quantity, row.data()["twin"], row.data()["planar"], row.verdict) for row in rows] == [
        (first.quantity, "33", "12", "within"),
        (second.quantity, "", "6.58", "not computed"),
        ("one of a new section", "3", "", "within"),
    ]


def test_readings_of_a_statement_have_a_line_each():
    said = statements.VARIANTS["stride 1.8 cm"].onset
    found = [
        of_twin(said, Result("25", 25.0, 0.0), "one"),
        of_twin(said, Result("40", 40.0, 0.0), "other"),
        OfPlanar(said, Result("11")),
    ]
    rows = robot_rows(found, statements.ORDER)
    assert [(row.quantity, row.data()["planar"], row.verdict) for row in rows] == [
        (f"{said.quantity} (one)", "11", "within"),
        (f"{said.quantity} (other)", "11", "outside"),
    ]


def test_a_line_is_data_too():
    """Words for people, and beside them the number, its error and its unit."""
    said = statements.ONSET
    found = [of_twin(said, Result("", 33.2, 0.4, "N*mm/deg", 1)), OfPlanar(said, Result(value=12.0, unit="N*mm/deg"))]
    (line,) = (row.data() for row in robot_rows(found, ()))
    assert line["twin"] == "33.2 ± 0.4 N*mm/deg"
    assert (line["value"], line["error"], line["unit"], line["planar_value"]) == (33.2, 0.4, "N*mm/deg", 12.0)
    json.dumps(line, allow_nan=False)


def test_what_is_not_determined_is_not_outside():
    lost = of_twin(statements.ONSET, Result("not determined by trials", np.nan, np.nan, "N*mm/deg"))
    assert lost.verdict is Verdict.NOT_DETERMINED
    (line,) = (row.data() for row in robot_rows([lost], ()))
    assert (line["value"], line["error"], line["twin"]) == (None, None, "not determined by trials")
