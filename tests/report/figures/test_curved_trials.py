"""Figures of the trials of curved walks: drawn from little data, no text cut or tiny, in both layouts."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from chilopod import load_robot
from chilopod.output import netcdf
from chilopod.paper import printed
from chilopod.paper.curved import study as curved_findings
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
def study():
    with pytest.MonkeyPatch.context() as patch:
        # As wide a range as in earnest, or the axes would be others.
        patch.setattr(curved_findings, "SPRINGS", (7.0, 8.5, 10.0, 41.0))
        patch.setattr(curved_findings, "AGREEMENT_SPRINGS", (8.0,))
        # Two variants are enough to draw.
        robot = load_robot("aoi2022-planar")
        two = {
            name: each for name, each in printed.variant_robots(robot).items() if name in ("as built", "stride 1.8 cm")
        }
        patch.setattr(printed, "variant_robots", lambda robot: two)
        return curved_findings.curved_study(robot, 3, 2)


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
