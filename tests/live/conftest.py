"""What the tests of the live page share."""

import pytest

from chilopod.analysis.parameters import stiffness
from chilopod.live.theory import theory_of
from chilopod.robot import load_robot

SPRINGS = stiffness(2.05), stiffness(61.5)  # of the slider, for the paper's robot


@pytest.fixture(scope="session")
def told():
    """Piece by piece what is known of the paper's robot."""
    pieces = []
    theory_of(
        load_robot("aoi2022-planar").with_value("springs.stiffness[0]", stiffness(8.0)),
        "planar",
        SPRINGS,
        pieces.append,
    )
    return pieces


@pytest.fixture(scope="session")
def law(told):
    """How tightly it turns."""
    return told[-1].law
