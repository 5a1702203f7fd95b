"""What trials of curved walks come to in both tables, on made-up trials."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from chilopod.paper import statements
from chilopod.paper.curved import sections as curved_rows
from chilopod.paper.table import OfPlanar, Row

MODE = np.array([0.64, 0.36, 0.48, 0.46, 0.16])
SPRINGS = (7.0, 10.0, 13.0, 41.0)


@pytest.fixture(autouse=True)
def without_branches(monkeypatch):
    """Radii that are in proportion to the spring, and no variants."""
    monkeypatch.setattr(curved_rows, "axis_radius", lambda branch, spring: 0.1 * spring)
    monkeypatch.setattr(statements, "VARIANTS", {})


def study(mode=MODE, bends=(1.2, 0.8, 0.0, 0.0), scatter=(0.02, 0.02, 0.0, 0.0), settled=True):
    """Six trials at each spring, every second one to the left."""
    side = np.tile([1.0, -1.0], 3)
    apart = np.array([1.0, 1.0, -1.0, -1.0, 0.5, -0.5])
    sizes = np.array(bends)[:, None] + np.array(scatter)[:, None] * apart
    turned = np.where(side > 0.0, "right", "left")
    trials = xr.Dataset(
        {
            "mean_angle": (("spring", "repeat", "joint"), (side * sizes)[..., None] * mode),
            "direction": (
                ("spring", "repeat"),
                np.where(np.array(bends)[:, None] > 0.0, turned, "straight").astype(object),
            ),
            "settled": (("spring", "repeat"), np.full(sizes.shape, settled)),
        },
        coords={"spring": list(SPRINGS), "joint": np.arange(1, 6)},
        attrs={"critical_k1": 12.0},
    )
    law = xr.Dataset({"power": ("softest", [0.36, 0.29])}, coords={"softest": [11.999, 11.88]})
    agreement = xr.DataArray([1e-9, np.nan])
    fit = SimpleNamespace(critical=12.9)
    return SimpleNamespace(trials=trials, law=law, agreement=agreement, fit=fit, branch=None)


def beside(found):
    return {row.statement: row.result.words for row in curved_rows.rows(found) if isinstance(row, OfPlanar)}


def test_the_order_of_the_joints_is_held_against_the_paper_s_mode():
    def verdicts(found):
        return {row.quantity: row.verdict for row in curved_rows.rows(found) if isinstance(row, Row)}

    what = "joints by how far they bend"
    assert [verdicts(study(mode))[what] for mode in (MODE, MODE[::-1])] == ["agrees", "differs"]
    almost = MODE.copy()
    almost[2], almost[3] = 0.459, 0.461
    assert verdicts(study(almost))[what] == "differs"
    assert set(verdicts(study()).values()) == {"agrees", "not printed"}


def test_no_words_beside_the_robot_are_judged():
    said = beside(study())
    assert said == {
        statements.STRAIGHT: "straight from 13 N*mm/deg up",
        statements.CURVED: "curved up to 10 N*mm/deg, 6 to the left and 6 to the right",
        statements.ONSET: "12.90 N*mm/deg; the point is at 12.00",
        statements.RADII[21.0]: "0.74 m at the same share of its point",
        statements.RADII[26.0]: "0.92 m at the same share of its point",
        statements.RISING: "increases",
        statements.FLUCTUATION: said[statements.FLUCTUATION],
    }


@pytest.mark.parametrize(("bends", "words"), [((1.2, 0.8), "increases"), ((0.8, 1.2), "not throughout")])
def test_whether_the_angle_rises(bends, words):
    assert beside(study(bends=(*bends, 0.0, 0.0)))[statements.RISING] == words


@pytest.mark.parametrize(("scatter", "word"), [((0.1, 0.01), "higher"), ((0.01, 0.1), "lower"), ((0.02, 0.02), "unde")])
def test_whether_the_scatter_grows(scatter, word):
    said = beside(study(scatter=(*scatter, 0.0, 0.0)))[statements.FLUCTUATION]
    assert said.startswith(word)
    assert said.endswith("at 7 than at 10 N*mm/deg")
