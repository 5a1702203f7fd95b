"""Figures of the whole robot's walks, on made-up findings: what they say is what was found."""

import pytest

from chilopod.paper.robot.figures.walks import panels
from chilopod.show import files
from helpers.made_up_robot import durations
from helpers.made_up_robot import walks as made_up_walks


@pytest.fixture(scope="module")
def drawn():
    found = made_up_walks(durations=durations((27.0, 30.0, 32.0, 34.0, 34.0)))
    return {panel.name: panel for panel in panels(found)}


def test_they_say_what_was_found(drawn):
    assert list(drawn) == ["robot-walks", "robot-joints", "robot-different", "robot-durations"]
    words = [" ".join(drawn[f"robot-{name}"].text).replace("\u00a0", " ") for name in ("different", "durations")]
    assert "1.8 cm, lower steps 25.0 (robot: 25)" in words[0]
    assert "onset 27.0, 30.0, 32.0, 34.0, 34.0 N·mm/deg after 20, 30, 40, 60 and 90 s" in words[1]
    assert "within after 40, 60 and 90, outside after 20 and 30" in words[1]
    assert "and the last onset may differ from that of settled walks alone, 34.0 N·mm/deg." in words[1]
    assert not any("nan" in each for each in words)
    (fork,) = (each for each in drawn["robot-walks"].draw(False).axes if each.get_title().startswith("C "))
    assert fork.get_legend().get_frame_on()  # before the line of the robot's onset
    lines = files.csv(drawn["robot-durations"].data).splitlines()
    assert lines[3].startswith("duration [s],spring,onset [N*mm/deg],axis_radius [m]")
    assert len(lines) == 4 + 5 * 7
