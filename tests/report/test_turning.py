"""Figures of the turning tasks: all text is shown, in both layouts, and what they say is what was found."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from chilopod import load_robot
from chilopod.report import style, tables
from chilopod.report.turning import panels
from chilopod.studies.turning_findings import turning


@pytest.fixture(scope="module")
def drawn():
    found = turning(load_robot("aoi2022-planar"), quick=True)
    return list(panels(found))


def painted(figure, monkeypatch) -> list[Text]:
    """The texts that are really painted: not those of hidden axes or of ticks outside the limits."""
    found = []
    draw = Text.draw
    with monkeypatch.context() as patch:
        patch.setattr(Text, "draw", lambda self, renderer: (found.append(self), draw(self, renderer)))
        FigureCanvasAgg(figure).draw()
    return [text for text in found if text.get_visible() and text.get_text().strip()]


@pytest.mark.parametrize("narrow", [False, True])
def test_no_text_is_cut_or_tiny(drawn, narrow, monkeypatch):
    for panel in drawn:
        with style.house_style():
            figure = panel.draw(narrow)
            for text in painted(figure, monkeypatch):
                box, extent = figure.bbox, text.get_window_extent()
                assert extent.x0 > -1 and extent.y0 > -1, (panel.name, text.get_text())  # noqa: PT018
                assert extent.x1 < box.x1 + 1 and extent.y1 < box.y1 + 1, (panel.name, text.get_text())  # noqa: PT018
                assert text.get_fontsize() >= style.SMALL, (panel.name, text.get_text())


def test_paths_are_drawn_with_equal_scales(drawn):
    by_name = {panel.name: panel for panel in drawn}
    with style.house_style():
        for name, letters in (("turning", ("A ", "B ")), ("turning-without", ("A ", "B "))):
            axes = [each for each in by_name[name].draw(False).axes if each.get_title(loc="left").startswith(letters)]
            assert len(axes) == 2
            assert all(each.get_aspect() == 1.0 for each in axes)


def test_every_figure_has_a_name_of_its_own_words_and_a_table(drawn):
    assert len({panel.name for panel in drawn}) == len(drawn) == 6
    for panel in drawn:
        text = " ".join((panel.title, panel.alt, *panel.text))
        assert "nan" not in text and "  " not in text, panel.name  # noqa: PT018
        assert panel.alt.endswith(".")
        assert len(tables.csv(panel.data).splitlines()) > 10


def test_the_shaded_springs_are_those_that_arrive(drawn):
    panel = next(panel for panel in drawn if panel.name == "turning-criteria")
    arrived = panel.data.spring.values[np.isfinite(panel.data.arrival.values).all(axis=1)]
    assert f"{arrived.min():g} to {arrived.max():g}" in panel.text[0]
