"""A replay shows itself in a notebook, as what it is written as."""

import pytest

from chilopod.errors import OutputError
from chilopod.show import replay
from helpers.html_page import Page
from helpers.walks import walk


def test_notebook_plays_the_page():
    shown = replay(walk(0.0, 0.6, duration=1.0), titles=['a "<b>"', "c"], heading='"Two" & <more>')
    ((tag, frame),) = Page(shown._repr_html_()).tags
    assert tag == "iframe"
    assert frame["srcdoc"] == shown.html
    assert frame["title"] == '"Two" & <more>'
    assert frame["sandbox"] == "allow-scripts"


def test_untitled_walks_are_numbered_and_few():
    shown = replay(walk(*[0.1] * 8, duration=1.0))
    assert shown.heading == "aoi2022-planar"
    assert "walk 6" in shown.html
    assert "walk 7" not in shown.html


def test_written_page_is_not_replaced_unasked(tmp_path):
    shown = replay(walk(0.0, duration=1.0))
    shown.write(tmp_path / "walk.html")
    assert (tmp_path / "walk.html").read_text(encoding="utf-8") == shown.html
    with pytest.raises(OutputError):
        shown.write(tmp_path / "walk.html")
