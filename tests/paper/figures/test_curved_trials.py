"""Figures of the trials of curved walks say and show what was found."""

import numpy as np
import pytest

from chilopod.netcdf import netcdf
from chilopod.paper.curved import figures
from chilopod.paper.curved.study import curved_study
from chilopod.paper.section import Context, Size
from chilopod.show import style
from chilopod.show.files import csv

PANELS = {"walks": figures.walks, "joints": figures.joints, "onset": figures.onset, "variants": figures.variants}


@pytest.fixture(scope="module")
def study(kept):
    return curved_study(Context(size=Size.TINY, folder=kept))


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
        axes = figures.walks(study).draw(False).axes
    (fork,) = (each for each in axes if each.get_ylabel() == "mean angle of joint 1 (deg)")
    shown = np.concatenate([line.get_ydata() for line in fork.get_lines() if line.get_marker() == "o"])
    angles = np.rad2deg(study.trials.mean_angle.sel(joint=1))
    for side in ("left", "right"):
        here = study.trials.direction == side
        means = angles.where(here).mean("repeat").where(here.sum("repeat") > 1).values
        for mean in means[np.isfinite(means)]:
            assert np.nanmin(np.abs(shown - mean)) < 1e-9
