"""What shows itself in a notebook is well-formed, holds its numbers, and takes no text for markup."""

from functools import partial
from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from chilopod import load_robot
from chilopod.analysis import pitchfork, straight_walk
from chilopod.notebook import block, folded, picture, table, words
from chilopod.stability import begin, follow, follow2, locate
from chilopod.steering import Target, course_named, strategy_named
from chilopod.tasks import Driver, drive, ends, turn, walk
from chilopod.tasks.walk import draw_paths
from chilopod.trials import Trial
from helpers import systems

ROBOT = load_robot("aoi2022-planar")
SVG = "{http://www.w3.org/2000/svg}"
NASTY = 'a <b> & "c"'


def read(html: str) -> ElementTree.Element:
    return ElementTree.fromstring(html)


def said(html: str) -> str:
    return " ".join(read(html).itertext())


def cells(html: str) -> list[list[str]]:
    return [[cell.text or "" for cell in row] for row in read(html).iter("tr")]


def targets(record: xr.Dataset) -> list[tuple[float, float]]:
    """Where the targets of a record are drawn."""
    axes = Figure().add_subplot()
    draw_paths(axes, record)
    return [patch.center for patch in axes.patches]


def test_text_is_no_markup():
    html = block(
        NASTY,
        words(NASTY),
        folded(NASTY, table([NASTY], [[NASTY]])),
        picture(lambda axes: axes.set(xlabel=NASTY), NASTY),
    )
    assert said(html).count(NASTY) == 6  # of the drawing's description there is an attribute
    assert read(html).find(f"{SVG}svg").get("aria-label") == NASTY


def test_long_tables_are_cut():
    html = table(["n"], [[i] for i in range(30)], most=20)
    assert len(cells(html)) == 1 + 20 + 1
    assert cells(html)[-1] == ["and 10 more"]


def test_a_picture_is_what_was_drawn_and_nothing_else():
    html = picture(lambda axes: axes.plot([0.0, 1.0], [2.0, 3.0], label="<b>"), NASTY)
    drawing = read(html)
    assert drawing.tag == f"{SVG}svg"
    assert drawing.get("aria-label") == NASTY
    assert picture(lambda axes: axes.plot([0.0, 1.0], [2.0, 3.0], label="<b>"), NASTY) == html
    assert "metadata" not in html
    assert not plt.get_fignums()


def test_robot():
    robot = ROBOT.override("springs.stiffness[0]", "8 N*mm/deg").with_(name=NASTY)
    drawing, html = read(robot._repr_svg_()), robot._repr_html_()
    assert len(list(drawing.iter(f"{SVG}rect"))) == 6
    assert [each.text for each in drawing.iter(f"{SVG}text")] == ["8", "41", "41", "41", "41"]
    assert NASTY in said(html)
    assert ["springs.stiffness[0]", "8 N*mm/deg", "set by override"] in cells(html)
    assert {row[0] for row in cells(html)[1:]} == set(robot.parameters())


@pytest.mark.parametrize("modules", [2, 20, 1000])
def test_robots_of_any_length_fit(modules):
    drawing = read(ROBOT.override("body.modules", modules)._repr_svg_())
    assert len(list(drawing.iter(f"{SVG}rect"))) == min(modules, 40)
    _, _, width, height = map(float, drawing.get("viewBox").split())
    for foot in drawing.iter(f"{SVG}circle"):
        assert 0.0 <= float(foot.get("cx")) <= width
        assert 0.0 <= float(foot.get("cy")) <= height


def test_straight_walk():
    found = straight_walk(ROBOT)
    assert "the straight walk is stable" in said(found._repr_html_())
    assert read(found._repr_html_()).find(f"{SVG}svg") is not None
    assert len(str(found).splitlines()) == 15  # and no more of a chain of any length
    assert float(cells(found._repr_html_())[1][0]) == pytest.approx(found.moduli[0], abs=1e-6)


def test_point():
    point = pitchfork(ROBOT)
    html = point._repr_html_()
    assert "pitchfork at springs.stiffness[0] = 11.99142966" in said(html)
    assert "Supercritical: " in said(html)
    assert len(point.plot(Figure().add_subplot()).patches) == 5
    assert [float(angle) for angle in cells(html)[1][1:]] == pytest.approx(point.joint_components.real, abs=1e-3)


def test_any_systems_points_and_branch():
    duffing = partial(systems.duffing, symmetry=-np.eye(2))
    found = locate(duffing, (2.3, 2.5), orbit=[1.9, 0.6])
    branch = follow(duffing, begin(duffing, 2.35, [1.9, 0.6], symmetric=True), (2.35, 2.45), symmetric=True)
    for result, drawn in ((found, True), (found[0], False), (branch, True)):
        html = result._repr_html_()
        assert [" ".join(text.split()) for text in read(html).find("pre").text.splitlines()] == [
            " ".join(line.split()) for line in str(result).splitlines()[1:]
        ]
        assert (read(html).find(f"{SVG}svg") is not None) is drawn


def test_any_systems_curve():
    (doubling,) = locate(lambda a: systems.henon(a, 0.3), (0.1, 0.8), orbit=[0.8, 0.24])
    html = follow2(systems.henon, doubling, ((0.05, 5.0), (-1.4, 0.7)), second=0.3)._repr_html_()
    assert "1:2 resonance" in said(html)
    assert "Curve2: period doubling" in said(html)


def test_walks():
    walks = walk(ROBOT, 2.0, seed=3, repeats=2, rate=10.0)
    html = walks._repr_html_()
    assert "aoi2022-planar, planar: 2 walks of 2 s" in said(html)
    assert [row[0] for row in cells(html)] == ["seed", "3", "4"]
    assert read(html).find(f"{SVG}svg").get("aria-label") == "paths of 2 walks from above"
    axes = Figure().add_subplot()
    draw_paths(axes, walks.record)
    assert [line.get_xydata().tolist() for line in axes.lines] == walks.record.position.transpose(
        "robot", "time", "axis"
    ).values.tolist()
    assert [line.get_xydata().shape for line in walks.plot(Figure().add_subplot()).lines] == [(21, 2)] * 2
    assert "straight" in said(ends(Trial(ROBOT, 1.0).repeated())._repr_html_())


def test_turn():
    done = turn(ROBOT, Target(np.radians(45.0), 1.3), strategy_named("leg-yaw"), duration=5.0)
    html = done._repr_html_()
    assert "turn to 45 deg, 1.3 m by leg-yaw" in said(html)
    assert targets(done.record) == [tuple(done.record.target.values[0])]
    assert len(cells(html)) == 2


def test_course():
    ready = Driver(ROBOT, strategy_named("leg-yaw"), None, None, "planar", remarks=(NASTY,))
    done = drive(ready, course_named("0 deg, 0.4 m; 170 deg, 1 m", patience=4.0))
    html = done._repr_html_()
    assert NASTY in said(html)
    assert [row[:2] for row in cells(html)[1:]] == [["1", "arrived"], ["2", "out of reach"]]
    assert 0.25 / ROBOT.gait.speed <= float(cells(html)[1][2]) < 4.0
    assert len(targets(done.record)) == 2
