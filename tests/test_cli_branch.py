"""`chilopod branch` as a user meets it: saving, resuming, and what is refused."""

import json
import shutil

import pytest
import xarray as xr

from chilopod.cli import main
from helpers.command_line import run

ROBOT = ("branch", "aoi2022-planar")
SHORT = ("--between", "9 N*mm/deg", "20 N*mm/deg", "--points", "3")


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    folder = tmp_path_factory.mktemp("branch")
    assert main([*ROBOT, *SHORT, "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def saved(original, tmp_path):
    return shutil.copytree(original, tmp_path, dirs_exist_ok=True)


def test_text_shows_verdict_and_direction():
    code, out, _ = run(*ROBOT, *SHORT)
    assert code == 0
    assert "the normal form says supercritical; the direction in which the branch leaves confirms it" in out
    assert "pitchfork" in out


def test_a_saved_branch_grows_in_its_place(saved, tmp_path):
    code, out, _ = run(*ROBOT, "--resume", saved, "--points", "2", "--json")
    assert code == 0
    result = json.loads(out)
    assert len(result["points"]) == 6
    with xr.open_dataset(saved / "branch.nc", engine="h5netcdf") as data:
        assert data.sizes["point"] == 6
    whole = json.loads(run(*ROBOT, *SHORT[:3], "--points", "5", "--json")[1])
    assert whole == result


def test_or_elsewhere(saved):
    before = (saved / "branch.nc").read_bytes()
    code, _, _ = run(*ROBOT, "--resume", saved, "--points", "1", "--out", saved / "new")
    assert code == 0
    assert (saved / "branch.nc").read_bytes() == before
    assert (saved / "new" / "branch.nc").exists()


def test_nothing_is_overwritten_unless_forced(saved):
    before = (saved / "branch.nc").read_bytes()
    code, out, err = run(*ROBOT, *SHORT, "--left", "--out", saved)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert "--force" in err
    assert (saved / "branch.nc").read_bytes() == before
    assert run(*ROBOT, *SHORT, "--left", "--out", saved, "--force")[0] == 0
    assert (saved / "branch.nc").read_bytes() != before


@pytest.mark.parametrize(
    ("extra", "expected"),
    [
        (("--set", "ground.friction=200 N*s/m"), "another robot"),
        (("--parameter", "springs.stiffness[1]"), "springs.stiffness[0]"),
        (("--left",), "error: --left: must be left out: the saved branch turns right"),
        (("--between", "15 N*mm/deg", "20 N*mm/deg"), "last point"),
    ],
)
def test_another_branch_is_refused_in_one_line(saved, extra, expected):
    before = (saved / "branch.nc").read_bytes()
    code, out, err = run(*ROBOT, "--resume", saved, *extra)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert expected in err
    assert (saved / "branch.nc").read_bytes() == before


def test_no_branch_to_resume(saved):
    beside, misspelt = saved.parent, saved.parent / f"{saved.name}s"
    nearest = f"; did you mean '{saved.name}'?"
    for folder, missing, more in ((beside, beside / "branch.nc", ""), (misspelt, misspelt, nearest)):
        code, out, err = run(*ROBOT, "--resume", folder)
        assert (code, out, len(err.splitlines())) == (2, "", 1)
        assert err.startswith(f"error: {missing}: --resume = ")
        assert f": does not exist{more}" in err


def test_the_interval_is_round_the_pitchfork_of_any_robot():
    code, out, _ = run(*ROBOT, "--points", "1", "--json", "--set", "ground.friction=24.65 N*s/m")
    assert code == 0
    first = json.loads(out)["points"][0]
    assert first["special"] == "pitchfork"
    assert first["value"] == pytest.approx(3.04, rel=1e-3)  # located on its own; far below the paper's springs
    code, _, err = run(*ROBOT, "--parameter", "legs.forward_offset")
    assert code == 2
    assert err.strip() == "error: --between: must be given for legs.forward_offset"
