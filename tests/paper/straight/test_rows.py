"""The table of the straight walk, on made-up findings: each row on both sides of what is asked, and none but that."""

import numpy as np
import pytest
import xarray as xr

from chilopod.paper import printed
from chilopod.paper.straight.sections import mode_rows, module_rows, uniform_rows, variant_rows
from chilopod.paper.table import OfPlanar, Row

VARIANTS = {printed.AS_BUILT: 12.0, **dict.fromkeys(printed.VARIANTS, 10.0), "module phase 180 deg": 11.5}
LONGER = {6: 12.0, 7: 12.4, 8: 11.6}


def mode(value=12.0, kind="pitchfork", **joints):
    components = [joints.get(f"joint_{joint}", paper.value) for joint, paper in enumerate(printed.MODE, 1)]
    said = {"value": value, "kind": kind, "error_bound": 1e-9, "criticality": "supercritical", "coefficient": -1e-3}
    return mode_rows(xr.Dataset({"computed": ("joint", components)}, attrs=said))


def variants(**changes):
    values = VARIANTS | {name: changes.get(name.partition(" ")[0].replace("-", "_"), k) for name, k in VARIANTS.items()}
    data = {"critical_k1": ("variant", list(values.values()))}
    return variant_rows(xr.Dataset(data, coords={"variant": list(values)}))


def modules(**changes):
    values = [changes.get(f"of_{count}", value) for count, value in LONGER.items()]
    return module_rows(xr.Dataset({"critical_k1": ("modules", values)}, coords={"modules": list(LONGER)}))


def uniform(kind="Neimark-Sacker"):
    numbers = dict.fromkeys(("value", "error_bound", "frequency_rad_s", "oscillation_period_s"), 6.5)
    return uniform_rows(xr.Dataset(attrs={**numbers, "kind": kind, "criticality": "supercritical"}))


def differing(rows):
    return [row.quantity for row in rows if isinstance(row, Row) and row.verdict == "differs"]


BOTH_SIDES = [
    *((mode, "value", inside, outside, "critical k1") for inside, outside in ((11.51, 11.49), (12.49, 12.51))),
    (mode, "kind", "pitchfork", "fold", "kind and direction"),
    *(
        (
            mode, f"joint_{joint}", paper.value + sign * 0.0049, paper.value + sign * 0.0051,
            f"critical mode, joint {joint}",
        )
        for joint, paper in enumerate(printed.MODE, 1)
        for sign in (-1.0, 1.0)
    ),
    (variants, "k2_5", 12.0 * 0.949, 12.0 * 0.951, "critical k1, k2-5 = 28 N*mm/deg"),
    (variants, "stride", 12.0 * 0.949, 12.0 * 0.951, "critical k1, stride 1.8 cm"),
    (variants, "module", 12.0 * 0.901, 12.0 * 0.899, "critical k1, module phase 180 deg"),
    (variants, "module", 12.0 * 1.099, 12.0 * 1.101, "critical k1, module phase 180 deg"),
    *(
        (modules, f"of_{count}", 12.0 * inside, 12.0 * outside, "critical k1 for 7 to 8 modules of the same size")
        for count in (7, 8)
        for inside, outside in ((0.901, 0.899), (1.099, 1.101))
    ),
    (uniform, "kind", "Neimark-Sacker", "pitchfork", "uniform springs: kind"),
]  # fmt: skip


@pytest.mark.parametrize(("made_up", "what", "inside", "outside", "quantity"), BOTH_SIDES)
def test_each_row_on_both_sides_of_what_is_asked(made_up, what, inside, outside, quantity):
    assert differing(made_up(**{what: inside})) == []
    assert differing(made_up(**{what: outside})) == [quantity]


def test_every_row_that_is_judged_is_tested():
    judged = [row for made_up in (mode, variants, modules, uniform) for row in made_up() if isinstance(row, Row)]
    tested = {quantity for *_, quantity in BOTH_SIDES}
    assert {row.quantity for row in judged if row.verdict != "not printed"} == tested


def test_variants_that_are_swapped_are_noticed():
    swapped = differing(variants(k2_5=VARIANTS["module phase 180 deg"], module=10.0))
    assert swapped == ["critical k1, k2-5 = 28 N*mm/deg", "critical k1, module phase 180 deg"]


def test_a_walk_that_is_not_lost_is_not_called_unchanged():
    assert differing(modules(of_7=np.nan)) == ["critical k1 for 7 to 8 modules of the same size"]


def test_a_robot_with_other_joints_has_no_printed_mode():
    said = {"value": 12.0, "kind": "pitchfork", "error_bound": 1e-9, "criticality": "", "coefficient": -1e-3}
    rows = mode_rows(xr.Dataset({"computed": ("joint", [0.6, 0.6, 0.5])}, attrs=said))
    assert [row.quantity for row in rows] == ["critical k1", "kind and direction"]


def test_the_planar_model_s_undulation_stands_beside_the_robot_s():
    assert [row.result.words for row in uniform() if isinstance(row, OfPlanar)] == ["6.50 N*mm/deg"]
