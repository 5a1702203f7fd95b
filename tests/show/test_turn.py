"""Figure of a turn: its walks can be told apart."""

import pytest

from chilopod import load_robot
from chilopod.show import style
from chilopod.show.figures.turn import draw
from chilopod.steering import STRATEGIES, Target
from chilopod.tasks import turn


@pytest.mark.parametrize(
    ("repeats", "names"),
    [
        (1, ["module 1, seed 1"]),
        (2, ["module 1, seed 1", "module 1, seed 2"]),
        (7, ["module 1, seed 1, 6", "module 1, seed 2, 7", *(f"module 1, seed {seed}" for seed in (3, 4, 5))]),
    ],
)
def test_paths_have_their_seeds_and_not_the_colour_of_the_target(repeats, names):
    target = Target.parse("45 deg, 1.3 m")
    done = turn(load_robot("aoi2022-planar"), target, STRATEGIES["leg-yaw"], duration=1.0, seed=1, repeats=repeats)
    with style.house_style():
        axes = draw(done).axes[0]
    handles, said = axes.get_legend_handles_labels()
    paths = {name: each.get_color() for each, name in zip(handles, said, strict=True) if "module 1" in name}
    assert list(paths) == names
    assert len({*paths.values(), style.SCENE["target"]}) == len(names) + 1
