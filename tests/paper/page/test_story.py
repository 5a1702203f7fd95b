"""What a page tells first."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot
from chilopod.paper import statements
from chilopod.paper.page.headline import pitchfork
from chilopod.paper.page.page import Drawings, Film, Shown, page
from chilopod.paper.robot.sections import WALKS
from chilopod.paper.section import Context, Found, Size
from chilopod.paper.table import Kind, OfPlanar, OfTwin, Result, Row, Statement, Verdict
from chilopod.show import style
from helpers.html_page import Page
from helpers.made_up_robot import walks


def test_verdicts_are_counted_and_each_count_leads_to_its_rows():
    twin = Statement("where it bends", statements.RISING.said, Kind.PREDICTED)
    lines = [OfTwin(twin, Result("5"), each) for each in (Verdict.WITHIN, Verdict.OUTSIDE, Verdict.NOT_DETERMINED)]
    lines += [Row("k", "1", Result("2"), "here", each) for each in (Verdict.AGREES, Verdict.NOT_PRINTED)]
    lines.append(OfPlanar(statements.ONSET, Result("12 N*mm/deg")))
    html = page(Found(Context(size=Size.QUICK), rows={WALKS: lines}), [WALKS], Drawings(), "aoi2022-planar")
    found = Page(html)
    strip = re.findall(r'data-look="(\w+)"><b>(\d)</b> ([a-z ]+)</a>', html)
    assert strip == [
        ("agrees", "2", "agree"),
        ("differs", "1", "differ"),
        ("undetermined", "1", "not determined"),
        ("more", "1", "need more trials"),
    ]
    looks = [attrs["data-look"] for tag, attrs in found.tags if tag == "tr" and attrs.get("class") == "row"]
    assert [looks.count(look) for look, *_ in strip] == [int(count) for _, count, _ in strip]
    assert "… needs more trials" in " ".join(found.text.split())


def test_the_headline_puts_trials_and_paper_on_one_axis():
    series = walks().base
    trials = series.assign_attrs(critical_k1=12.0).assign_coords(spring=series.spring * 12.0 / 34.0)
    bends = np.linspace(0.0, 1.0, 4)
    branch = xr.Dataset(
        {"mean_angle": (("point", "joint"), np.outer(bends, np.full(5, 0.2))), "stable": ("point", bends < 0.9)},
        coords={"parameter": ("point", np.linspace(12.0, 6.0, 4))},
    )
    panel = pitchfork(load_robot("aoi2022"), SimpleNamespace(trials=trials, branch=branch), walks())
    data = panel.data
    assert data.paper_share.values == pytest.approx([21 / 34, 21 / 34, 26 / 34, 26 / 34, 41 / 34, 75 / 34])
    assert data.paper_bend.values[:2] == pytest.approx(np.rad2deg([1.125 / 0.88, -1.125 / 0.88]))
    assert data.planar_bend.values == pytest.approx(data.twin_bend.values)
    assert data.planar_share.values == pytest.approx(data.twin_share.values, rel=0.1)
    assert (data.planar_bend > 1.0).any()
    assert (data.planar_bend < -1.0).any()
    with style.house_style():
        drawn = [len(panel.draw(narrow).axes[0].lines) for narrow in (False, True)]
    assert drawn == [9, 9]


def test_a_page_begins_with_the_robot_in_three_dimensions_if_it_is_there():
    planar, stills = Film("planar", "flat", 1.0, True), Film("robot", "turns", 1.0, False, True)
    both = Film("robot", "turns", 1.0, True, True)
    for films, first in (
        ([planar], ("video", "movies/planar.mp4", "movies/planar-poster.png")),
        ([planar, stills], ("img", "movies/robot.png", None)),
        ([planar, both], ("video", "movies/robot.mp4", "movies/robot-poster.png")),
    ):
        html = page(Found(), [WALKS], Drawings(shown=[Shown(WALKS, [], films)]), "aoi2022-planar")
        header = html[html.index("<header>") : html.index("<nav")]
        (shown,) = [(tag, a.get("src"), a.get("poster")) for tag, a in Page(header).tags if tag in ("video", "img")]
        assert shown == first
    assert "<video" not in page(Found(), [WALKS], Drawings(), "aoi2022-planar")
