"""The sentences that say what is seen."""

import re
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from chilopod.analysis.parameters import stiffness
from chilopod.engine import Status
from chilopod.live import Session, wishes
from chilopod.live.theory import Growth, Stretch, Theory, growth_of
from chilopod.live.words import sentences
from chilopod.robot import load_robot
from chilopod.steering import RadiusLaw

PLANAR = load_robot("aoi2022-planar")
LAW = RadiusLaw(stiffness(1.0) * np.array([6.0, 8.0, 10.0, 12.0]), np.array([0.25, 0.32, 0.5, np.inf]), "N*mm/deg")
STRAIGHT = (Stretch(0.0, LAW.pitchfork, False), Stretch(LAW.pitchfork, stiffness(61.5), True, "pitchfork"))
THEORY = Theory(PLANAR, LAW.pitchfork, LAW.values[::-1], LAW.radii[::-1], np.ones(4, dtype=bool), LAW, STRAIGHT)


@pytest.fixture
def begun():
    return Session(PLANAR)


def said(session, theory=THEORY, rate=None, **seen):
    growth = None if rate is None else Growth(session.settings.robot, rate)
    return " ".join(sentences(replace(session.seen(), **seen), session.settings, theory, growth))


def curve(radius, side=-1.0):
    """A body along the circle that it walks on."""
    angles = side * np.full(5, PLANAR.module_length / radius)
    return {"mean_angles": angles, "turned": -angles.sum()}


def soft(spring):
    return {"stiffness": stiffness(1.0) * np.array([spring, 41.0, 41.0, 41.0, 41.0])}


def test_every_state_has_its_sentence(begun):
    assert said(begun).startswith(
        "Straight and stable: its first spring, 41 N·mm/deg, is stiffer than the pitchfork at"
    )
    assert "fades by 18 % a second" in said(begun, rate=-0.2)
    unjudged = said(begun, replace(THEORY, straight=()))
    assert unjudged.startswith("It walks straight on: its first spring, 41 N·mm/deg, is stiffer")
    assert "stable" not in unjudged
    assert "The curve of 0.40 m straightens" in said(begun, **curve(0.4), turning=-0.1)
    assert "The curve of 0.40 m will straighten" in said(begun, **curve(0.4), turning=0.1)
    begun.box.put(wishes.Spring(0, stiffness(8.0)))
    begun.obey()
    grows = said(begun, rate=0.125)
    assert "the smallest bend grows by 13 % a second, to 0.32 m in the end" in grows
    assert "tightens towards the branch's 0.32 m" in said(begun, **soft(8.0), **curve(0.9), turning=0.1)
    assert "0.20 m to the right, widens" in said(begun, **soft(8.0), **curve(0.2, 1.0), turning=-0.1)
    assert said(begun, **soft(8.0), **curve(0.33), turning=0.001).startswith("Settled on a curve of 0.33 m to the left")
    assert "no settled curve is known" in said(begun, **soft(3.0))
    assert "not known yet: it is computed" in said(begun, Theory(remark="it is computed", computing=True))
    assert "no pitchfork in the first spring to show: a fold" in said(begun, Theory(remark="a fold"))
    pulled = said(begun, pulled=np.array([0.0, 0.1, 0.0, 0.0, 0.0]), **curve(0.9))
    assert pulled == "Joint 2 is pulled aside, and it walks a curve of 0.90 m to the left as long as that lasts."
    assert said(begun, pulled=np.array([0.0, 0.1, 0.0, 0.0, -0.1])).startswith("Joints 2, 5 are pulled aside")
    assert "It has stopped: a yaw joint bent" in said(begun, status=Status.OUT_OF_RANGE)


def test_an_undulating_robot_walks_no_curve():
    """Its bend changes sides."""
    session, known = Session(PLANAR), Theory(remark="it sways")
    for wish in (wishes.Spring(None, stiffness(3.0)), wishes.Spring(0, stiffness(20.0))):
        session.box.put(wish)
        session.obey()
    growth, bent, swaying = growth_of(session.settings.robot), 0, 0
    for _ in range(60):
        session.walk_on(1.0)
        seen = session.seen()
        bent += seen.bend > 0.3
        told = " ".join(sentences(seen, session.settings, known, growth))
        assert "curve" not in told
        swaying += "It walks on, swaying from side to side." in told
        assert "a sway from side to side grows by 12 % a second" in told
    assert bent > 20
    assert swaying > 20


def test_a_bend_that_stays_on_its_side_after_undulations_is_a_curve(begun):
    begun._left.clear()
    told = []
    for each in [*np.repeat([True, False, True, False], 10), *np.ones(21, dtype=bool)]:
        begun._left.append(each)
        told.append(begun.seen().undulates)
    assert told == [False] * 30 + [True] * 30 + [False]
    assert "swaying from side to side" in said(begun, replace(THEORY, straight=()), **curve(0.4), undulates=True)


@pytest.mark.parametrize(
    ("angles", "turned", "walks"),
    [
        (np.full(5, 0.2), -1.0, "a curve of 1.12 m to the right"),  # 5 * 0.225 m / 1 rad
        (np.full(5, 0.2), -0.3, "on, bent to the right just now"),
        (np.full(5, 0.2), -9.0, "on, bent to the right just now"),
        (np.full(5, 0.2), 1.0, "on, bent to the right just now"),
        (np.full(5, 0.2), np.nan, "on, bent to the right just now"),  # it has not walked its own length
        (np.array([0.4, 0.4, 0.2, -0.5, -0.3]), -0.2, "on, bent both ways just now"),
    ],
)
@pytest.mark.parametrize("doing", ["walks", "pulled", "steered"])
def test_a_curve_is_one_where_body_and_path_agree(begun, angles, turned, walks, doing):
    pulled = {"pulled": np.full(5, 0.1)} if doing == "pulled" else {}
    steered = {"target": (2.0, 0.0), "steering": "leg-yaw"} if doing == "steered" else {}
    seen = replace(begun.seen(), mean_angles=angles, turned=turned, **pulled, **steered)
    (text,) = sentences(seen, begun.settings, Theory(), None)[-1:]
    assert f"it walks {walks}" in text.replace("It", "it")
    for theory, spring in ((THEORY, 41.0), (THEORY, 8.0)):
        text = said(begun, theory, mean_angles=angles, turned=turned, **pulled, **steered, **soft(spring))
        assert ("curve of 1.12 m" in text or "The curve, 1.12 m" in text) == ("curve" in walks)


def test_the_turn_of_the_path_is_that_over_the_length_of_the_axis():
    """In a gait cycle the robot walks stride / duty; the axis is (N-1) L."""
    walking = Session(PLANAR)
    walking.walk_on(1e-9)  # a little more than whole cycles
    gait = PLANAR.gait
    back = round(5 * PLANAR.module_length * gait.duty / gait.stride)
    headings = []
    for _ in range(back + 8):
        walking.walk_on(gait.period)
        headings.append(walking.seen().pose[2])
        turned = walking.seen().turned
        known = len(headings) > back
        expected = headings[-1] - headings[-1 - back] if known else np.nan
        assert turned == pytest.approx(expected, abs=1e-6, nan_ok=True)
    walking.box.put(wishes.Reset(2))
    walking.obey()
    assert np.isnan(walking.seen().turned)


@pytest.mark.parametrize("steered", [False, True])
def test_a_sway_is_no_curve_from_its_first_swing_on(steered):
    """All springs soft: its joints bend to both sides."""
    walking = Session(PLANAR, seed=3, strategy="leg-yaw")
    walking.box.put(wishes.Spring(None, stiffness(2.05)))
    if steered:
        walking.box.put(wishes.Target((11.0, 11.0)))
    walking.obey()
    told, bent = "", 0
    for _ in range(60):
        walking.walk_on(0.5)
        told += " ".join(sentences(walking.seen(), walking.settings, Theory(remark="it sways"), None))
        bent += walking.seen().bend > 0.3
    assert "curve" not in told
    assert bent > 40


@pytest.mark.parametrize(
    ("radius", "turning", "sentence"),
    [
        (1.78, 0.1, "1.78 m to the left, tightens towards the branch's 0.32 m."),
        (1.78, -0.1, "1.78 m to the left, is wider than the branch's 0.32 m, and widens just now."),
        (1.78, 0.0, "1.78 m to the left, is wider than the branch's 0.32 m."),
        (0.2, -0.1, "0.20 m to the left, widens towards the branch's 0.32 m."),
        (0.2, 0.1, "0.20 m to the left, is tighter than the branch's 0.32 m, and tightens just now."),
    ],
)
def test_a_curve_goes_towards_the_branch_only_if_it_does(begun, radius, turning, sentence):
    assert said(begun, **soft(8.0), **curve(radius), turning=turning).endswith(sentence)


def test_a_spring_that_the_strategy_holds_is_told_from_the_one_of_the_slider(begun):
    begun.box.put(wishes.Spring(0, stiffness(8.0)))
    begun.box.put(wishes.Target((2.0, 0.0)))
    begun.obey()
    steered = said(begun, **soft(41.0), **curve(0.9), target=(2.0, 0.0), steering="variable")
    assert "with the strategy variable. The strategy has the first spring at 41 N·mm/deg now; yours, 8 N" in steered
    assert steered.endswith("Steered, it walks a curve of 0.90 m to the left.")
    assert "stable" not in steered
    assert "yours" not in said(begun, **soft(8.0))


def test_the_strategy_that_is_named_is_the_one_that_steers(begun):
    """As long as nobody knows how tightly which spring turns, leg yaw alone steers."""
    begun.box.put(wishes.Target((2.0, 0.0)))
    begun.obey()
    assert begun.settings.strategy == "variable"
    assert "with the strategy leg-yaw" in said(begun)


def test_growth_of_another_robot_does_not_count(begun):
    other = Growth(PLANAR, -0.2)
    assert "fades" not in " ".join(sentences(begun.seen(), begun.settings, THEORY, other))


def test_targets_and_pauses_are_said_first(begun):
    begun.box.put(wishes.Pause(True))
    begun.box.put(wishes.Target((2.0, 0.0)))
    begun.obey()
    first, second, *_ = sentences(begun.seen(), begun.settings, THEORY, None)
    assert first.startswith("Paused")
    assert second.startswith("On its way to the target, 2.00 m off")


_SPRINGS, _BODIES = (41.0, 8.0, 3.0), ({}, curve(0.33), curve(0.2, 1.0))
_KNOWN = (THEORY, Theory(remark="computing the pitchfork", computing=True), Theory(remark="a fold comes first"))
_DOING = ("walks", "grows", "fades", "paused", "pulled", "aimed", "by hand")


@pytest.mark.parametrize(("spring", "body", "theory", "doing"), [*product(_SPRINGS, _BODIES, _KNOWN, _DOING)])
def test_the_words_are_right_in_every_state(spring, body, theory, doing):
    session = Session(PLANAR)
    session.box.put(wishes.Spring(0, stiffness(spring)))
    if doing in ("aimed", "by hand"):
        session.box.put(wishes.Target((2.0, 0.5), by_hand=doing == "by hand"))
    if doing == "paused":
        session.box.put(wishes.Pause(True))
    session.obey()
    rate = {"grows": 0.2, "fades": -0.2}.get(doing)
    pulled = {"pulled": np.array([0.1, 0.0, 0.0, 0.0, 0.0])} if doing == "pulled" else {}
    seen, growth = (
        replace(session.seen(), **body, **pulled),
        None if rate is None else Growth(session.settings.robot, rate),
    )
    each = sentences(seen, session.settings, theory, growth)
    text, bent, soft_one = " ".join(each), bool(body), theory is THEORY and spring < 12.0
    assert all(re.fullmatch(r"[A-Z].*\.", sentence) for sentence in each)
    assert not re.search(r"\b(nan|inf|None)\b|  |\.\.", text)
    assert text.startswith("Paused") == (doing == "paused")
    assert ("On its way to the target" in text) == (doing == "aimed")
    assert ("nothing but you steers" in text) == (doing == "by hand")
    assert ("pulled" in text) == (doing == "pulled")
    quiet = doing not in ("aimed", "pulled")
    assert ("Past the pitchfork" in text) == (soft_one and quiet)
    assert ("Straight and stable" in text) == (
        theory is THEORY and spring > 12.0 and quiet and not bent and rate != 0.2
    )
    assert ("unstable" in text) <= (rate == 0.2 or (soft_one and not bent))
    assert ("Settled on" in text) <= (spring == 8.0 and body is _BODIES[1])
    if re.search("to the (left|right)", text):
        assert bent
        assert f"to the {'left' if body['mean_angles'].sum() < 0.0 else 'right'}" in text
    if theory is not THEORY:
        assert (theory.remark in text) == quiet
