"""Figures of the turning tasks: what they say is what was found."""

import numpy as np
import pytest

from chilopod.paper.section import Context, Size
from chilopod.paper.turning.figures import panels
from chilopod.paper.turning.study import turning
from chilopod.show import files, style


@pytest.fixture(scope="module")
def drawn(kept):
    found = turning(Context(folder=kept, size=Size.TINY))
    return list(panels(found))


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
        assert len(files.csv(panel.data).splitlines()) > 10


def test_the_shaded_springs_are_those_that_arrive(drawn):
    panel = next(panel for panel in drawn if panel.name == "turning-criteria")
    most = np.isfinite(panel.data.arrival.values).mean(axis=1) > 0.5
    arrived = panel.data.spring.values[most]
    assert f"{arrived.min():g} to {arrived.max():g}" in panel.text[0]
