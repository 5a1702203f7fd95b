"""What shows itself in a notebook is well-formed, holds its numbers, and takes no text for markup."""

import math
from xml.etree import ElementTree

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.analysis import pitchfork, straight_walk
from chilopod.notebook import Line, Mark, block, folded, plot, table, words
from chilopod.stability import PeriodicSystem, begin, follow, follow2, from_rhs, locate
from chilopod.steering import Target, course_named, strategy_named
from chilopod.tasks import Driver, drive, ends, planned, turn, walk

ROBOT = load_robot("aoi2022-planar")
SVG = "{http://www.w3.org/2000/svg}"
NASTY = 'a <b> & "c"'


def read(html: str) -> ElementTree.Element:
    return ElementTree.fromstring(html)


def said(html: str) -> str:
    return " ".join(read(html).itertext())


def cells(html: str) -> list[list[str]]:
    return [[cell.text or "" for cell in row] for row in read(html).iter("tr")]


def ways(drawing: ElementTree.Element) -> list[list[tuple[float, float]]]:
    """The points of every line that is no tick, px."""
    return [
        [tuple(map(float, point.split(","))) for point in line.get("points").split()]
        for line in drawing.iter(f"{SVG}polyline")
        if line.get("stroke-width") != "1"
    ]


def test_text_is_no_markup():
    html = block(NASTY, words(NASTY), folded(NASTY, table([NASTY], [[NASTY]])), plot([], x=NASTY, y=NASTY, alt=NASTY))
    assert said(html).count(NASTY) == 7  # of the drawing's description there is an attribute
    assert read(html).find(f"{SVG}svg").get("aria-label") == NASTY


def test_long_tables_are_cut():
    html = table(["n"], [[i] for i in range(30)], most=20)
    assert len(cells(html)) == 1 + 20 + 1
    assert cells(html)[-1] == ["and 10 more"]


def test_plot_places_points():
    drawing = read(plot([Line([(0.0, 0.0), (1.0, 2.0), (2.0, 1.0)])], [Mark(2.0, 1.0)], x="x", y="y", alt=""))
    ((first, second, third),) = ways(drawing)
    assert first[0] < second[0] < third[0]
    assert first[1] > third[1] > second[1]  # up is up
    (mark,) = drawing.iter(f"{SVG}circle")
    assert (float(mark.get("cx")), float(mark.get("cy"))) == third


def test_plot_with_one_scale():
    drawing = read(plot([Line([(0.0, 0.0), (1.0, 1.0)])], x="x", y="y", alt="", equal=True))
    (((x0, y0), (x1, y1)),) = ways(drawing)
    assert x1 - x0 == pytest.approx(y0 - y1, abs=0.2)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_lines_are_interrupted_where_nothing_is(value):
    points = [(0.0, 1.0), (1.0, 1.0), (2.0, value), (3.0, 1.0), (4.0, 1.0)]
    assert [len(way) for way in ways(read(plot([Line(points)], x="x", y="y", alt="")))] == [2, 2]


@pytest.mark.parametrize("points", [[], [(1.0, math.nan)], [(1e-9, 3.0)], [(0.0, 1e15), (1.0, 1e15 + 1.0)]])
def test_plot_of_next_to_nothing(points):
    read(plot([Line(points)], x="x", y="y", alt=""))


def test_lines_have_no_more_points_than_are_seen():
    ((*way,),) = ways(read(plot([Line([(float(i), 0.0) for i in range(5001)])], x="x", y="y", alt="")))
    assert len(way) < 400


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
    assert float(cells(found._repr_html_())[1][0]) == pytest.approx(found.moduli[0], abs=1e-6)


def test_point():
    point = pitchfork(ROBOT)
    html = point._repr_html_()
    assert "pitchfork at springs.stiffness[0] = 11.99142966 N·mm/deg" in said(html)
    assert "Supercritical: " in said(html)
    assert [float(row[1]) for row in cells(html)[1:]] == pytest.approx(point.joint_components.real, abs=1e-3)


def duffing(force):
    return from_rhs(
        lambda t, x, force: [x[1], force * np.cos(t) - 0.2 * x[1] - x[0] ** 3],
        2,
        2.0 * np.pi,
        args=(force,),
        symmetry=-np.eye(2),
    )


def test_any_systems_points_and_branch():
    found = locate(duffing, (2.3, 2.5), orbit=[1.9, 0.6])
    assert cells(found._repr_html_())[1] == [
        "pitchfork",
        "2.40337711606",
        f"{found[0].error_bound:.1e}",
        "supercritical",
    ]
    assert "pitchfork at 2.40337711606" in said(found[0]._repr_html_())
    branch = follow(duffing, begin(duffing, 2.35, [1.9, 0.6], symmetric=True), (2.35, 2.45), symmetric=True)
    drawing = read(branch._repr_html_()).find(f"{SVG}svg")
    whole, stable = ways(drawing)
    assert len(whole) == len(branch.points)
    assert stable == whole[: len(stable)]
    (mark,) = drawing.iter(f"{SVG}circle")
    assert (float(mark.get("cx")), float(mark.get("cy"))) == stable[-1]


def henon(a, b):
    def image(x):
        return np.array([1 - a * x[0] ** 2 + x[1], b * x[0]]), np.array([[-2 * a * x[0], 1], [b, 0]])

    return PeriodicSystem(2, 1.0, lambda x, t0, t1: image(x), flow_with_error=lambda x, t0, t1: (*image(x), 1e-15))


def test_any_systems_curve():
    (doubling,) = locate(lambda a: henon(a, 0.3), (0.1, 0.8), orbit=[0.8, 0.24])
    html = follow2(henon, doubling, ((0.05, 5.0), (-1.4, 0.7)), second=0.3)._repr_html_()
    assert cells(html)[1][0] == "1:2 resonance"
    assert "period doubling in two parameters" in said(html)


def test_walks():
    walks = walk(ROBOT, 2.0, seed=3, repeats=2, rate=10.0)
    html = walks._repr_html_()
    assert "aoi2022-planar, planar: 2 walks of 2 s" in said(html)
    assert [row[0] for row in cells(html)] == ["seed", "3", "4"]
    assert len(ways(read(html).find(f"{SVG}svg"))) == 2
    assert "straight" in said(ends(planned(ROBOT, 1.0))._repr_html_())


def test_turn():
    done = turn(ROBOT, Target(np.radians(45.0), 1.3), strategy_named("leg-yaw"), duration=5.0)
    html = done._repr_html_()
    assert "turn to 45 deg, 1.3 m by leg-yaw" in said(html)
    assert len(list(read(html).iter(f"{SVG}circle"))) == 1
    assert len(cells(html)) == 2


def test_course():
    ready = Driver(ROBOT, strategy_named("leg-yaw"), None, None, "planar", remarks=(NASTY,))
    html = drive(ready, course_named("0 deg, 0.4 m; 170 deg, 1 m", patience=4.0))._repr_html_()
    assert NASTY in said(html)
    assert cells(html)[1][:2] == ["-", "1 of 2"]
    assert 0.25 / ROBOT.gait.speed <= float(cells(html)[1][2]) < 4.0
    assert len(list(read(html).iter(f"{SVG}circle"))) == 2
