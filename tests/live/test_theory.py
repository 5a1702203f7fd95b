"""What is computed beside the walk."""

import re
import time
from itertools import combinations

import pytest

from chilopod.analysis import radius_laws
from chilopod.analysis.parameters import K1, stiffness
from chilopod.live.plots import STABLE, UNSTABLE, drawn
from chilopod.live.theory import Beside, Growth, Theory, growth_of, theory_of
from chilopod.robot import load_robot

PLANAR = load_robot("aoi2022-planar")
SPRINGS = stiffness(2.05), stiffness(61.5)


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


@pytest.mark.parametrize(
    ("spring", "stretches"),
    [(3.0, [False, False, False]), (6.0, [False, False, True])],
    ids=["sways everywhere", "sways when soft"],
)
def test_a_straight_walk_that_sways_is_not_drawn_as_a_stable_one(spring, stretches):
    """A pitchfork alone does not say whether it is stable above."""
    robot, pieces = PLANAR.with_value("springs.stiffness", stiffness(spring)), []
    theory_of(robot, "planar", SPRINGS, pieces.append)
    known = pieces[-1]
    assert known.pitchfork is None
    assert [each.stable for each in known.straight] == stretches
    assert [each.begins for each in known.straight] == ["", "pitchfork", "sway"]
    assert known.straight[-1].high >= SPRINGS[1]
    for k1 in (5.0, 8.0, 20.0, 60.0):
        assert known.verdict(stiffness(k1)) is (growth_of(robot.with_value(K1, stiffness(k1))).rate < 0.0)
    picture = drawn(known, SPRINGS[1], [(stiffness(20.0), 0.0)])
    assert picture.count(STABLE) == sum(stretches)
    assert picture.count(UNSTABLE) == 3 - sum(stretches)
    assert ("sway 10.3" in picture) == any(stretches)


def test_the_words_in_the_picture_keep_apart():
    """No line of a remark beside a branch reaches over the axis, or another line."""
    remark = "subcritical: beside the pitchfork the curved walks are unstable, and the robot jumps"
    picture = drawn(Theory(PLANAR, stiffness(12.0), remark=remark), SPRINGS[1], [])
    texts = re.findall(r'<text x="([\d.]+)" y="([\d.]+)" text-anchor="(\w+)">([^<]+)', picture)
    boxes = []
    for x, y, anchor, text in texts:
        width = 6.0 * len(text)
        left = float(x) - width * {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor]
        boxes.append((left, left + width, float(y) - 9.0, float(y) + 2.0))
    for one, other in combinations(boxes, 2):
        assert one[1] <= other[0] or other[1] <= one[0] or one[3] <= other[2] or other[3] <= one[2]
    assert "subcritical: beside" in picture
    assert STABLE not in picture  # nobody has judged the straight walk


@pytest.mark.parametrize(("bend", "labels"), [(0.0, "−45 0 45"), (100.0, "−90 0 90"), (-200.0, "−180 −90 0 90 180")])
def test_the_axis_of_bends_has_a_scale(bend, labels):
    """At least one number above and below 0, also where no branch is known."""
    picture = drawn(Theory(), SPRINGS[1], [(stiffness(2.05), bend)])
    assert " ".join(re.findall(">(−?[0-9]+)°<", picture)) == labels


def test_what_cannot_be_known_is_said():
    pieces = []
    theory_of(PLANAR.with_value("gait.side_phase", 0.0), "planar", SPRINGS, pieces.append)
    last = pieces[-1]
    assert last.law is None
    assert last.remark == "no pitchfork in the interval"


def test_only_the_last_question_is_answered_and_a_short_one_in_between():
    beside = Beside("planar")
    try:
        wide = PLANAR.with_value("gait.stride", 0.029)
        beside.ask(PLANAR, SPRINGS)
        beside.ask(wide, SPRINGS)
        beside.ask(PLANAR)
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
    beside.ask(PLANAR, SPRINGS)  # to nobody
    (said,) = beside.answers()
    assert "has ended" in said.remark
    assert not said.computing
    assert beside.answers() == []
