"""Settings of all tests."""

import os

import pytest
from hypothesis import settings

from chilopod.robot import Robot, load_robot

# In CI the same examples every time, so that a submission is judged by its own changes; at a desk new ones each run.
# No deadlines: how long an example takes is the machine's affair.
settings.register_profile("desk", deadline=None)
settings.register_profile("ci", derandomize=True, deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "desk")


@pytest.fixture(scope="session")
def former() -> Robot:
    """The planar robot with the constants for which other programs computed the numbers that ours are held against."""
    return load_robot("aoi2022-planar").set_from_text(
        ["ground.friction=256.5 N*s/m", "legs.half_width=72.8 mm", "legs.forward_offset=48 mm"]
    )
