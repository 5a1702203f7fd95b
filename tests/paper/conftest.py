"""Results small enough to draw in a moment; sweeps and profiles are made up where only their shape matters."""

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot
from chilopod.paper.printed import critical_mode_data
from chilopod.paper.registry import chosen
from chilopod.paper.section import Context, Found, Movie, Size, reproduce
from chilopod.paper.straight.sections import EXPONENTS, IDENTIFICATION, MODE, MODULES
from chilopod.paper.table import Result, Row, Verdict
from chilopod.paper.turning.sections import MOVIES
from chilopod.tasks.identify import Identification
from chilopod.tasks.identify.planar_fit import FREE
from helpers.walks import walk as WALK


@pytest.fixture(scope="session")
def results() -> Found:
    found = reproduce(chosen(["mode", "variants", "uniform"]), Context(size=Size.QUICK))
    assert not found.failures
    odd = Row("a <b> & c", "1 N*mm/deg", Result("-2e-10 N*mm/deg"), "nowhere", Verdict.DIFFERS, "for <script>")
    found.rows[MODE] = [*found.rows[MODE], odd]
    # What a sweep and a count of modules look like, without computing them.
    k1 = np.geomspace(75.0, 2.0, 40)
    square = np.log(13.0 / k1) * 0.02
    root = np.sqrt(square.astype(complex))
    values = np.stack([-0.08 + root, -0.08 - root, -60.0 + 0.0 * root], axis=-1)
    found.values[EXPONENTS] = xr.Dataset(
        {
            "real": (("k1", "exponent"), values.real, {"units": "1/s"}),
            "imaginary": (("k1", "exponent"), values.imag, {"units": "rad/s"}),
            "follows_critical": (("exponent",), np.array([True, False, False])),
        },
        coords={"k1": ("k1", k1, {"units": "N*mm/deg"})},
        attrs={"robot": "aoi2022-planar"},
    )
    found.values[MODULES] = xr.Dataset(
        {
            "critical_k1": (("modules",), np.array([10.0, np.nan, 12.0, 12.1, 12.2]), {"units": "N*mm/deg"}),
            "error_bound": (("modules",), np.full(5, 1e-10), {"units": "N*mm/deg"}),
            "says": (("modules",), np.array(["supercritical", "no pitchfork", *["subcritical"] * 3], dtype=object)),
        },
        coords={"modules": np.arange(4, 9)},
        attrs={"built": 6},
    )
    return found


@pytest.fixture(scope="session")
def fit() -> Identification:
    offsets = np.linspace(0.03, 0.07, 7)
    profile = xr.Dataset(
        {
            name: (("forward_offset",), values, {"units": unit})
            for name, values, unit in (
                ("friction", np.linspace(259.0, 228.0, 7), "N*s/m"),
                ("half_width", np.linspace(0.057, 0.088, 7), "m"),
                ("largest_residual", np.array([1.6, 1.1, 0.8, 0.7, 0.7, 1.1, 1.5]), "1"),
                ("critical_k1", np.linspace(11.3, 12.6, 7), "N*mm/deg"),
                ("k2-5 = 28 N*mm/deg", np.linspace(8.3, 9.5, 7), "N*mm/deg"),
                ("uniform", np.linspace(3.7, 9.6, 7), "N*mm/deg"),
                ("coefficient", np.linspace(0.017, -0.024, 7), "1/rad^2"),
                ("verdict", np.array(["subcritical"] * 3 + ["supercritical"] * 4), ""),
            )
        },
        coords={"forward_offset": ("forward_offset", offsets, {"units": "m"})},
    )
    robot = load_robot("aoi2022-planar")
    ranges = np.array([[231.0, 250.0], [0.06, 0.085], [0.04, 0.06]])
    off, given = np.full(6, 0.5), np.full(6, -1.02)
    return Identification(
        given=robot, data=critical_mode_data(), constants=np.array([robot.get(path) for path in FREE]), residuals=off,
        starts=np.zeros((1, 3)), preset_residuals=given, ranges=ranges, intervals=np.full((3, 2), np.nan),
        cut=np.zeros((2, 3, 2), dtype=bool), spread=np.eye(3), group=np.full(2, np.nan), profile=profile,
    )  # fmt: skip


@pytest.fixture(scope="session")
def full(results, fit) -> Found:
    found = results.copy()
    found.values[IDENTIFICATION] = fit
    found.values[MOVIES] = [Movie("movie-1", "Two walks", ("left", "right"), WALK(0.5, -0.5, duration=1.0), 2.0)]
    return found
