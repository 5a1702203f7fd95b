"""`chilopod map` as a user meets it."""

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from helpers.command_line import run

MAP = ("map", "aoi2022-planar", "--x", "springs.stiffness[0]", "10 N*mm/deg", "14 N*mm/deg", "--y", "modules", "6", "7")


def test_files_and_text_say_the_same(tmp_path):
    code, out, _ = run(*MAP, "--points", "9", "--out", tmp_path)
    assert code == 0
    assert "curves: 1 of pitchfork" in out
    names = {"map.nc", "map.csv", "map-curves.csv", "map.svg", "map.png", "map.json", "map-rates.nc"}
    assert {path.name for path in tmp_path.iterdir()} == names
    with xr.open_dataset(tmp_path / "map.nc", engine="h5netcdf") as data:
        assert data.sizes == {"x": 9, "y": 2, "point": 2}
        growth = data.growth.values
    table = pd.read_csv(tmp_path / "map.csv", comment="#")
    assert list(table.columns[:3]) == ["y", "x [N*mm/deg]", "growth [1/s]"]
    np.testing.assert_array_equal(table["growth [1/s]"], growth.ravel())
    assert table.folded.isna().all()  # folds were not followed
    again = run(*MAP, "--points", "9", "--json", "--force", "--out", tmp_path)
    assert again[0] == 0
    assert json.loads(again[1]) == json.loads((tmp_path / "map.json").read_text())
    assert len(json.loads(again[1])["curves"][0]["values_si"]) == 2
    code, _, err = run(*MAP, "--points", "9", "--out", tmp_path)
    assert (code, len(err.splitlines())) == (2, 1)
    assert "--force" in err


def test_a_map_without_curves_is_written_too(tmp_path):
    code, _, err = run("map", "aoi2022-planar", "--x", MAP[3], "2", "2.5", *MAP[6:], "--points", "3", "--out", tmp_path)
    assert code == 0
    said = f"note: a number without a unit is SI: --x {MAP[3]} is 2 N*m/rad to 2.5 N*m/rad, that is 34.91 N*mm/deg to"
    assert said in err
    assert (tmp_path / "map-curves.csv").read_text().splitlines()[-1].startswith("point,curve_x")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (("--show", "kind,grwth"), "--show = 'kind,grwth': must name pictures"),
        (("--points", "1"), "--points"),
        (("--y", "modules", "6", "7.5"), "--y modules = '6 7.5': must be whole numbers"),
        (("--y", "gait.stride", "3 kg", "4 kg"), "is a mass; allowed: a length"),
        (("--y", "springs.stiffness", "1", "2"), "must not change a number that x changes"),
    ],
)
def test_what_is_wrong_takes_a_line(wrong, said):
    code, out, err = run(*(MAP[:6] if wrong[0] == "--y" else MAP), *wrong)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert said in err
