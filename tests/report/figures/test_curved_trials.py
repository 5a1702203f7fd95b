"""Figures of the trials of curved walks: drawn from little data, no text cut or tiny, in both layouts."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from chilopod import load_robot
from chilopod.netcdf import netcdf
from chilopod.paper.curved.study import curved_study
from chilopod.paper.size import Size
from chilopod.report.figures import curved_trials, curved_variants
from chilopod.report.kit import style
from chilopod.report.kit.tables import csv

PANELS = {
    "walks": curved_trials.walks,
    "joints": curved_trials.joints,
    "onset": curved_trials.onset,
    "variants": curved_variants.panel,
}


@pytest.fixture(scope="module")
def study(kept):
    return curved_study(load_robot("aoi2022-planar"), kept, Size.TINY)


@pytest.mark.parametrize("narrow", [False, True])
@pytest.mark.parametrize("name", PANELS)
def test_all_text_is_there(study, name, narrow, monkeypatch):
    painted = []
    draw = Text.draw
    monkeypatch.setattr(Text, "draw", lambda self, renderer: (painted.append(self), draw(self, renderer)))
    with style.house_style():
        figure = PANELS[name](study).draw(narrow)
        FigureCanvasAgg(figure).draw()
        for text in painted:
            if text.get_visible() and text.get_text().strip():
                box = text.get_window_extent()
                inside = box.x0 > -1 and box.y0 > -1 and box.x1 < figure.bbox.x1 + 1 and box.y1 < figure.bbox.y1 + 1
                assert inside, text.get_text()
                assert text.get_fontsize() >= style.SMALL, text.get_text()


@pytest.mark.parametrize("name", PANELS)
def test_panels_say_what_is_drawn_and_store_it(study, name):
    panel = PANELS[name](study)
    assert panel.alt
    assert all(panel.text)
    assert "nan" not in " ".join((panel.alt, *panel.text))
    assert netcdf(panel.data)
    assert csv(panel.data).count("\n") > 5


def test_the_fork_shows_every_mean(study):
    with style.house_style():
        axes = curved_trials.walks(study).draw(False).axes
    (fork,) = (each for each in axes if each.get_ylabel() == "mean angle of joint 1 (deg)")
    shown = np.concatenate([line.get_ydata() for line in fork.get_lines() if line.get_marker() == "o"])
    angles = np.rad2deg(study.trials.mean_angle.sel(joint=1))
    for side in ("left", "right"):
        here = study.trials.direction == side
        means = angles.where(here).mean("repeat").where(here.sum("repeat") > 1).values
        for mean in means[np.isfinite(means)]:
            assert np.nanmin(np.abs(shown - mean)) < 1e-9
