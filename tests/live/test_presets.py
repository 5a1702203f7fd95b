"""Presets, and settings in the address."""

from urllib.parse import urlencode

import pytest

from chilopod.analysis.parameters import stiffness
from chilopod.live import Session, wishes
from chilopod.live.presets import OWN, PRESETS, preset_of, query, read
from chilopod.live.sliders import sliders_of
from chilopod.robot import load_robot

PLANAR = load_robot("aoi2022-planar")
SLIDERS = sliders_of(PLANAR)


def test_an_address_leads_to_its_settings_and_they_lead_to_it():
    begun = Session(PLANAR)
    before = begun.settings
    found, wrong = read("k1=8&seed=2&friction=0.5&token=x&darkMode=&stride=2", SLIDERS)
    assert wrong == ""
    assert found[-1] == wishes.Reset(2)  # with everything else as it is asked for
    for wish in found:
        begun.box.put(wish)
    begun.obey()
    assert begun.settings.robot.springs.stiffness[0] == pytest.approx(stiffness(8.0))
    assert query(begun.settings, before, SLIDERS, OWN) == "k1=8&friction=0.5&stride=2&seed=2"
    begun.box.put(wishes.Steering("leg-yaw"))
    begun.obey()
    assert query(begun.settings, before, SLIDERS, OWN).endswith("&seed=2&strategy=leg-yaw")
    assert query(before, before, SLIDERS, "ten modules") == "robot=ten+modules&seed=1"


@pytest.mark.parametrize(
    ("asked", "part"),
    [
        ("k1=99", "k1 = 99"),
        ("k1=nan", "must be a number"),
        ("k1=", "must be a number"),
        ("k1=1e999", "must be a number"),
        ("seed=-1", "whole number"),
        ("seed=1.5", "whole number"),
        ("speed=<script>", "must be a number"),
        ("strategy=varible", "did you mean 'variable'"),
        ("robot=nine+modules", "must be a preset"),
        ("frction=1", "did you mean 'friction'"),
        (urlencode({"x" * 5000: "y" * 5000}), "must be a setting"),
    ],
)
def test_nonsense_in_an_address_is_one_line_and_changes_nothing(asked, part):
    found, wrong = read(asked, SLIDERS)
    assert found == []
    assert part in wrong
    assert "\n" not in wrong
    assert len(wrong) < 400
    good, wrong = read(f"{asked}&k2=9", SLIDERS)  # what is right beside it holds
    assert len(good) == 1
    assert wrong


def test_names_that_contain_the_separator_are_quoted():
    wrong = read("robot=nope", SLIDERS)[1]
    assert wrong.endswith(
        "allowed: 'as started', 'paper, planar', 'paper, whole robot', 'ten modules', "
        "'slippery floor', 'uniform soft springs'"
    )


def test_many_mistakes_in_an_address_are_one_short_line():
    found, wrong = read(urlencode({f"unknown{number}": 1 for number in range(60)}), SLIDERS)
    assert found == []
    assert wrong.count("friction") == 1
    assert [f"unknown{number} = " in wrong for number in range(60)] == [True] * 5 + [False] * 55
    assert wrong.endswith("; and 55 more")


def test_an_address_of_too_many_parts_is_none():
    assert read("&".join(["k1=8"] * 1000), SLIDERS) == ([], "")


def test_every_preset_walks():
    for name, preset in PRESETS.items():
        assert preset_of(urlencode({"robot": name})) == name
        if not preset.robot:
            continue
        begun = Session(preset.load(), preset.engine)
        found, wrong = read(preset.settings, begun.sliders)
        assert wrong == ""
        for wish in found:
            begun.box.put(wish)
        begun.obey()
        begun.walk_on(0.7)
        assert begun.messages() == []
        assert begun.seen().robot.body.modules == (preset.modules or 6)
