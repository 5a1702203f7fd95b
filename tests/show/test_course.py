"""The picture and the replay of a course: what they say is what the record has."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from chilopod.errors import OutputError
from chilopod.show import style
from chilopod.show.figures.course import draw
from chilopod.show.files import files_of_walks, write_walks
from chilopod.steering import STRATEGIES
from helpers.html_page import Page
from helpers.walks import on_course, walk


@pytest.fixture(scope="module")
def done():
    nan = [np.nan, np.nan]
    record = on_course(
        walk(0.0, 0.5),
        [[[0.3, 0.0], [0.6, 0.5], nan], [[0.3, 0.0], [0.3, 0.0], [0.5, 0.2]]],
        [[[0.0, 2.0], [2.0, 6.0], nan], [[0.0, 1.0], [1.0, 2.0], [2.0, 6.0]]],
        [["arrived", "given up", "not tried"], ["arrived"] * 3],
    )
    return SimpleNamespace(record=record, strategy=STRATEGIES["pitchfork"], engine="planar", pitchfork=0.7)


@pytest.mark.parametrize("narrow", [False, True])
def test_the_picture_names_targets_and_what_became_of_them(done, narrow):
    with style.house_style():
        floor, spring, angle = draw(done, narrow).axes
        assert floor.get_title(loc="left") == "pitchfork: 4 of 6 targets"
        assert floor.get_aspect() == 1.0
        assert [each.get_text() for each in floor.texts] == ["1", "2", "walk 1: 2 given up; 3 not tried"]
        assert [each.get_text() for each in spring.texts] == ["bends below", "1", "2"]
        # Of the second target the line starts anew.
        (line,) = [each for each in angle.lines if each.get_color() == style.CURVES[0]]
        assert np.flatnonzero(np.isnan(line.get_ydata())).tolist() == [100]


def test_the_dot_is_where_the_distance_is_measured(done):
    """Half a module ahead of it a missed target looked reached."""
    with style.house_style():
        floor = draw(done).axes[0]
    dots = [each.get_xydata()[0] for each in floor.lines if each.get_markersize() == 4.5]
    first = done.record.isel(robot=0)
    walked = first.position.transpose("time", "axis").sel(time=[0.0, 2.0], method="nearest").values
    np.testing.assert_allclose(dots[:2], walked, atol=1e-12)


@pytest.mark.parametrize(("targets", "lines"), [(1, 3), (0, 1)])
def test_a_target_that_stays_or_none_at_all_is_drawn_too(done, targets, lines):
    """As of a course that ends with its first target, or has none that can be reached."""
    kept = done.record.drop_vars("target")
    if targets:
        kept["target"] = done.record.target.isel(time=0)
    with style.house_style():
        *_, angle = draw(SimpleNamespace(**{**vars(done), "record": kept})).axes
        assert len(angle.lines) == lines
        assert not any(np.isnan(line.get_ydata()).any() for line in angle.lines)


def test_its_files(done, tmp_path, monkeypatch):
    monkeypatch.setattr("chilopod.show.scene.film.Film.mp4", lambda film: b"a film")  # that of courses is in test_film
    assert write_walks("course", done, tmp_path, replace=False) == files_of_walks("course", tmp_path)
    page = Page((tmp_path / "course.html").read_text())
    first, second = json.loads(page.data)["robots"]
    assert [aim["reached"] for aim in first["aims"]] == [2.0, None]
    assert second["outcome"]["text"] == "all 3 targets by 6.0 s"
    assert "reached within" in page.text
    with pytest.raises(OutputError):
        write_walks("course", done, tmp_path, replace=False)
