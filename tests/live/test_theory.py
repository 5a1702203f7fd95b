"""What is computed beside the walk."""

import time

import pytest

from chilopod.analysis import radius_laws
from chilopod.analysis.parameters import stiffness
from chilopod.live.theory import Beside, Growth, Theory, growth_of, theory_of
from chilopod.robot import load_robot

PLANAR = load_robot("aoi2022-planar")


def test_the_law_is_that_of_everybody_else(told):
    law = radius_laws(PLANAR).axis
    known = told[-1]
    assert known.remark == ""
    assert known.pitchfork == pytest.approx(law.pitchfork, rel=1e-9)
    for spring in (11.0, 8.0):
        assert known.settled(stiffness(spring)) == pytest.approx(law.radius(stiffness(spring)), rel=1e-4)
    assert known.settled(stiffness(20.0)) == float("inf")
    assert known.settled(stiffness(1.9)) is None


def test_the_pitchfork_is_told_before_the_branch(told):
    first = next(each for each in told if each.pitchfork is not None)
    assert first.law is None
    assert first.settled(stiffness(8.0)) is None
    assert "computing the branch" in first.remark
    assert first.computing
    assert not told[-1].computing


def test_growth_changes_its_sign_at_the_pitchfork(told):
    fork = told[-1].pitchfork
    below, above = (growth_of(PLANAR.with_value("springs.stiffness[0]", part * fork)).rate for part in (0.98, 1.02))
    assert below > 0.0 > above


def test_what_cannot_be_known_is_said():
    pieces = []
    theory_of(PLANAR.with_value("gait.side_phase", 0.0), "planar", pieces.append)
    last = pieces[-1]
    assert last.law is None
    assert last.remark == "no pitchfork in the interval"


def test_only_the_last_question_is_answered_and_a_short_one_in_between():
    beside = Beside("planar")
    try:
        wide = PLANAR.with_value("gait.stride", 0.029)
        beside.ask(PLANAR)
        beside.ask(wide)
        beside.ask(PLANAR, "growth")
        found, end = [], time.monotonic() + 120.0
        while time.monotonic() < end:
            found += beside.answers()
            if any(isinstance(each, Theory) and each.pitchfork is not None for each in found):
                break
            time.sleep(0.05)
        assert {each.robot for each in found if isinstance(each, Theory) and each.pitchfork is not None} == {wide}
        assert [each.rate for each in found if isinstance(each, Growth)] == [growth_of(PLANAR).rate]
    finally:
        beside.close()
    beside.ask(PLANAR)  # to nobody
    assert beside.answers() == []
