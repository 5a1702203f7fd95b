"""The scaling law of critical springs, and what the atlas says."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chilopod.analysis import Onset, bifurcations, pitchfork, spring_scale
from chilopod.analysis.map_axes import Plane
from chilopod.analysis.parameters import ALL, K1, PAPER_UNIT
from chilopod.errors import ParameterError
from chilopod.paper.atlas.maps import CHARTS
from chilopod.paper.atlas.scaling import collapse, critical, inertia, panel, predicted, scaled
from chilopod.paper.section import Context, Size
from chilopod.robot import load_robot
from chilopod.show.words import number
from chilopod.stability import Kind
from chilopod.units import from_si

ROBOT = load_robot("aoi2022-planar")
DOCS = Path(__file__).parents[3] / "docs" / "atlas.md"
FACTORS = st.floats(-2.0, 2.0).map(lambda power: 10.0**power)


@given(mass=FACTORS, length=FACTORS, time=FACTORS)
def test_robots_of_one_shape_and_inertia_are_one_robot(mass, length, time):
    """By units alone: the friction goes with mass over time."""
    found = scaled(ROBOT, mass=mass, length=length, time=time, friction=mass / time)
    assert inertia(found) == pytest.approx(inertia(ROBOT), rel=1e-12)
    assert critical(found) == pytest.approx(critical(ROBOT), rel=1e-9)


@given(mass=FACTORS, time=FACTORS, inert=st.floats(-4.0, -1.0), stride=st.floats(0.3, 2.0), rest=st.floats(0.3, 3.0))
def test_the_law_predicts_critical_springs(law, mass, time, inert, stride, rest):
    found = scaled(ROBOT, mass=mass, time=time, stride=stride)
    found = found.with_value("ground.friction", found.ground.friction * inertia(found) / 10.0**inert)
    for joint in range(1, 5):
        found = found.with_value(f"{ALL}[{joint}]", rest * spring_scale(found))
    assert inertia(found) == pytest.approx(10.0**inert)
    assert critical(found) == pytest.approx(predicted(found, law), rel=0.08)


@pytest.fixture(scope="module")
def law():
    return collapse(Context(size=Size.QUICK))


def test_the_figure_says_what_the_docs_say(law):
    text = " ".join(DOCS.read_text(encoding="utf-8").split())
    assert float(law.scale.max() / law.scale.min()) == pytest.approx(20.0)  # twentyfold
    spread = panel(law).text[0].rpartition("agree to ")[2].replace("\u00a0", " ").rstrip(".")
    assert f"their curves agree to {spread}" in text
    assert f"It is {number(from_si(spring_scale(ROBOT), PAPER_UNIT), 3)} N·mm/deg" in text
    assert f"bends at {number(critical(ROBOT), 3)} of it" in text
    assert f"as built has {number(inertia(ROBOT), 2)}" in text
    assert f"{number(float(law.law.sel(stride=1.0)[-1] / law.law.sel(stride=1.0)[0]), 2)} times as large at" in text


def test_where_the_law_ends():
    """As the docs say: a dip of 5 %, and a rise of 10 % at an inertia of some 1.6."""
    light = critical(scaled(ROBOT, mass=0.01))
    off = {at: critical(scaled(ROBOT, mass=at / inertia(ROBOT))) / light - 1.0 for at in (0.009, 0.08, 1.39, 1.73)}
    assert off[0.009] == pytest.approx(-0.01, abs=2e-3)
    assert off[0.08] == pytest.approx(-0.05, abs=3e-3)
    assert off[1.39] < 0.1 < off[1.73]


def test_a_robot_far_from_home_has_its_onset():
    """Its critical spring is a hundred times the largest that was once searched."""
    strong = scaled(ROBOT, time=0.01)
    assert pitchfork(strong, normal_form=False).value > 750.0
    assert Onset().first(strong).point.value > 40.0
    with pytest.raises(ParameterError, match=r"^between: must be given for legs\.forward_offset$"):
        Onset("legs.forward_offset")


def onset(letter, value):
    """Critical value on the horizontal axis, in its unit."""
    chart = CHARTS[letter]
    robot = ROBOT if chart.k1 is None else ROBOT.override(K1, chart.k1)
    plane = Plane.over(robot, chart.x, chart.y)
    other = plane.y.high if value == "high" else plane.y.low if value == "low" else value
    *_, last = bifurcations(plane.y.change(robot, other), plane.x.path, (plane.x.low, plane.x.high), normal_form=False)
    assert last.point.kind is (Kind.NEIMARK_SACKER if letter == "F" else Kind.PITCHFORK)
    return from_si(last.point.value, plane.x.unit)


def test_the_phase_hardly_moves_the_onset():
    found = [onset("C", math.radians(phase)) for phase in range(60, 181, 5)]
    said = CHARTS["C"].words.format(least="11.1", most="12.5")
    assert said in " ".join(DOCS.read_text(encoding="utf-8").split())
    assert (min(found), max(found)) == (pytest.approx(11.1, abs=0.1), pytest.approx(12.5, abs=0.1))


@pytest.mark.parametrize("letter", "BDEFGH")
def test_maps_show_what_their_sentences_say(letter):
    """In the report and in the docs."""
    low = math.nan if letter == "F" else onset(letter, "low")
    high = onset(letter, "high")
    said = CHARTS[letter].words.format(low=number(low, 3), high=number(high, 3))
    assert said in " ".join(DOCS.read_text(encoding="utf-8").split())
    if letter == "D":
        six = onset(letter, 6)
        assert low < six < onset(letter, 4)
        assert max(abs(onset(letter, count) / six - 1.0) for count in (7, 10, 13)) < 0.05
    elif letter == "F":
        assert onset(letter, 0.04) < high
    else:
        assert low < high
