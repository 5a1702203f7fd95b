"""Figures of the whole robot's walks, on made-up findings: what they say is what was found."""

import runpy
from pathlib import Path

import pytest

from chilopod.report.figures.robot_walks import panels
from chilopod.report.kit import tables

MADE_UP = runpy.run_path(str(Path(__file__).parents[2] / "paper" / "robot" / "made_up_robot.py"))


@pytest.fixture(scope="module")
def drawn():
    found = MADE_UP["walks"](durations=MADE_UP["durations"]((27.0, 30.0, 32.0, 34.0, 34.0)))
    return {panel.name: panel for panel in panels(found)}


def test_they_say_what_was_found(drawn):
    assert list(drawn) == ["robot-walks", "robot-joints", "robot-different", "robot-durations"]
    words = [" ".join(drawn[f"robot-{name}"].text).replace("\u00a0", " ") for name in ("different", "durations")]
    assert "1.8 cm, lower steps 25.0 (robot: 25)" in words[0]
    assert "onset 27.0, 30.0, 32.0, 34.0, 34.0 N·mm/deg after 20, 30, 40, 60 and 90 s" in words[1]
    assert "within after 40, 60 and 90, outside after 20 and 30" in words[1]
    assert not any("nan" in each for each in words)
    lines = tables.csv(drawn["robot-durations"].data).splitlines()
    assert lines[1].startswith("duration,spring,onset")
    assert len(lines) == 2 + 5 * 7
