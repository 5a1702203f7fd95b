"""Figures show all of their text, for robots of many kinds."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from chilopod import load_robot
from chilopod.paper.straight import exponents, schematic
from chilopod.paper.straight.sections import EXPONENTS
from chilopod.show import style, words
from chilopod.show.scene.outline import chain, turned_about_tail
from helpers.texts import watched as WATCHED

PRESET = load_robot("aoi2022-planar")
ROBOTS = {
    "two modules": PRESET.with_value("body.modules", 2),
    "twenty": PRESET.with_value("body.modules", 20).with_value("body.length", 4.5),
    "feet behind": PRESET.override("legs.forward_offset", "-0.03 m"),
    "feet at the middle": PRESET.override("legs.forward_offset", "0 m"),
    "unequal springs": PRESET.set_from_text(["springs.stiffness[0]=12.345 N*mm/deg"]),
    "wide": PRESET.override("legs.half_width", "0.3 m"),
}


@pytest.mark.parametrize("kind", ROBOTS)
def test_schematic_of_any_robot(kind):
    """In the narrow layout, which has the least room; reports show whether text of the other is cut."""
    with style.house_style(), WATCHED() as painted:
        FigureCanvasAgg(schematic.panel(ROBOTS[kind]).draw(True)).draw()
    assert painted.count > 10
    assert painted.cut == []


def test_text_that_is_cut_or_tiny_is_noticed():
    drawn = Figure(figsize=(1, 1))
    for text, x, size in (("all there", 0.1, 9.0), ("sticks out", 0.9, 10.0), ("tiny", 0.1, 8.0), (" ", 2.0, 1.0)):
        drawn.text(x, 0.5, text, fontsize=size)
    with WATCHED() as painted:
        FigureCanvasAgg(drawn).draw()
    assert (painted.count, painted.cut, painted.tiny) == (3, ["sticks out"], ["tiny"])


def test_style_leaves_no_trace():
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    with style.house_style():
        assert mpl.rcParams["font.size"] == 10.0
    assert dict(mpl.rcParams) == before


def test_feet_are_where_the_gait_has_them():
    data = schematic.legs(PRESET)
    gait = PRESET.gait
    schedule = gait.schedule(6)
    np.testing.assert_array_equal(data.stands.values, schedule.contact[0])
    reach = data.foot_x.values - data.centre_x.values[:, None] - PRESET.legs.forward_offset
    standing = schedule.contact[0]
    np.testing.assert_allclose(reach[standing], schedule.stroke[0][standing], atol=1e-15)
    assert np.isnan(reach[~standing]).all()
    phase = (data.touch_down.values / gait.period + gait.leg_phases(6)) % 1.0
    np.testing.assert_allclose(np.minimum(phase, 1.0 - phase), 0.0, atol=1e-12)


def test_chain_hangs_together():
    angles = np.array([0.3, -0.2, 0.5])
    centres, headings, joints = turned_about_tail(*chain(angles, 0.2))
    ahead = 0.1 * np.stack([np.cos(headings), np.sin(headings)], axis=-1)
    np.testing.assert_allclose(centres[:-1] - ahead[:-1], joints, atol=1e-15)
    np.testing.assert_allclose(centres[1:] + ahead[1:], joints, atol=1e-15)
    np.testing.assert_allclose(np.diff(headings), angles, atol=1e-15)
    np.testing.assert_allclose([*centres[-1], headings[-1]], 0.0, atol=1e-15)
    # Positive joint angles: the front points to the right of the rear.
    assert turned_about_tail(*chain([0.1, 0.1], 1.0))[0][0, 1] < 0.0


def test_curves_meet_where_a_pair_becomes_real(results):
    data = results[EXPONENTS]
    k1 = data.k1.values
    ks, real, imaginary = exponents._joined(data)
    exact = np.sqrt((0.02 * np.log(13.0 / ks)).astype(complex))
    np.testing.assert_allclose(real[:, 0] + 1j * imaginary[:, 0], -0.08 + exact, atol=1e-7)
    np.testing.assert_allclose(real[:, 1] + 1j * imaginary[:, 1], -0.08 - exact, atol=1e-7)
    assert np.abs(ks - 13.0).min() < 1e-9
    assert set(np.round(k1, 9)) <= set(np.round(ks, 9))


def test_words():
    assert words.spans([4, 7, 8, 9, 10, 20]) == "4, 7 to 10 and 20"
    assert words.spans([3, 4]) == "3 and 4"
    assert words.listing([]) == ""
    assert words.k(12) == "k₁₂"
    assert words.number(12.001145, 5) == "12.001"
    assert words.number(41.0, 2) == "41"
    assert words.number(-8e-5, 1) == "−8e−05"
    assert words.typeset("-0.5 to 3e-10 N*mm/deg, k2-5") == "−0.5 to 3×10⁻¹⁰\u00a0N·mm/deg, k₂–k₅"
    assert words.typeset("Neimark-Sacker") == "Neimark-Sacker"
