"""Figures of courses, on made-up ones: what they say is what was found."""

import numpy as np
import pytest

from chilopod.paper.courses import figures as courses
from chilopod.paper.courses.sections import Robust
from chilopod.show import files, style
from helpers.made_up_courses import compared, conditions


@pytest.fixture(scope="module")
def drawn():
    data = compared()
    robust = Robust(data.isel(case=slice(4)), conditions(worse=["one"]))
    panels = [*courses.panels(data), courses.robust(robust), courses.strategies(compared(engine="twin"))]
    return {panel.name: panel for panel in [*panels, courses.whole(conditions())]}


@pytest.mark.parametrize("narrow", [False, True])
def test_every_figure_has_words_a_table_and_two_layouts(drawn, narrow):
    assert list(drawn) == ["courses", "courses-where", "courses-robust", "robot-courses", "robot-courses-robust"]
    with style.house_style():
        for panel in drawn.values():
            text = " ".join((panel.title, panel.alt, *panel.text))
            assert "nan" not in text
            assert panel.alt.endswith(".")
            assert len(files.csv(panel.data).splitlines()) > 5
            assert len(panel.draw(narrow).axes) >= 1


def test_bars_end_where_the_intervals_do(drawn):
    with style.house_style():
        reached, *_ = drawn["courses"].draw(False).axes
        targets, _ = reached.containers
        assert targets[0].get_xdata()[:2] == pytest.approx([100.0, 60.0])
        low, high = (caps.get_xdata()[1] for caps in targets[1])
        assert (low, high) == pytest.approx((53.1, 66.6), abs=0.1)


def test_the_map_has_every_target_where_it_was_put_up(drawn):
    data = compared(arrived=lambda values: np.where(np.arange(5) == 0, 0.0, 1.0) * np.ones_like(values))
    share = courses.share_map(data.sel(case="variable"))
    assert np.nanmean(share) == pytest.approx(0.8, abs=0.1)
    missed = data.isel(goal=[0]).sel(case="variable")
    assert np.nanmax(courses.share_map(missed)) == 0.0


def test_conditions_that_do_harm_are_named(drawn):
    text = " ".join(drawn["courses-robust"].text)
    assert "clearly fewer with one (0.0 % (0.0 to 8.8))" in text
    assert "beyond doubt under these: as usual and another" in text
    assert "under every one of them" in " ".join(drawn["robot-courses-robust"].text)
