"""What a page tells first."""

from chilopod.paper import statements
from chilopod.paper.page.page import Film, Shown, page
from chilopod.paper.page.story import Fact, facts
from chilopod.paper.robot.sections import WALKS
from chilopod.paper.section import Found
from chilopod.paper.table import Kind, OfPlanar, OfTwin, Result, Statement, Verdict, within
from helpers.html_page import Page


def found(*rows):
    return Found(rows={WALKS: rows})


def test_numbers_of_the_twin_stand_beside_those_of_the_robot():
    told = facts(found(OfTwin(statements.ONSET, Result("33.2 N*mm/deg (-2 %)"), Verdict.WITHIN)))
    about = "front spring at which the robot begins to curve, in three dimensions"
    assert told == [Fact("33.2\u00a0N·mm/deg (−2\u00a0%)", about, "34\u00a0N·mm/deg")]


def test_what_was_predicted_is_counted():
    def row(name, answer, kind=Kind.PREDICTED):
        return OfTwin(Statement(name, statements.RISING.said, kind), Result("5"), within(answer))

    rows = [row("a", True), row("b", False), row("c", None), row("d", True, Kind.FITTED)]
    assert [fact.value for fact in facts(found(*rows))] == ["1 of 3"]


def test_what_was_not_computed_is_not_told():
    assert facts(found(OfPlanar(statements.ONSET, Result("12 N*mm/deg")))) == []
    assert facts(Found()) == []


def test_a_page_begins_with_the_robot_in_three_dimensions_if_it_is_there():
    planar, stills = Film("planar", "flat", 1.0, True), Film("robot", "turns", 1.0, False, True)
    both = Film("robot", "turns", 1.0, True, True)
    for films, first in (
        ([planar], ("video", "movies/planar.mp4", None)),
        ([planar, stills], ("img", "movies/robot.png", None)),
        ([planar, both], ("video", "movies/robot.mp4", "movies/robot.png")),
    ):
        html = page(Found(), [WALKS], [], [Shown(WALKS, [], films)], {}, [], "aoi2022-planar")
        header = html[html.index("<header>") : html.index("<nav")]
        (shown,) = [(tag, a.get("src"), a.get("poster")) for tag, a in Page(header).tags if tag in ("video", "img")]
        assert shown == first
    assert "<video" not in page(Found(), [WALKS], [], [], {}, [], "aoi2022-planar")
