"""The whole robot on the command line: ``walk`` and ``turn`` with ``--engine twin``, ``identify twin``."""

import importlib
from functools import partial

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot
from chilopod.cli import main
from chilopod.paper.printed import base_series_data
from chilopod.tasks.identify import twin
from chilopod.tasks.identify.twin_series import Series
from helpers.command_line import printed

ROBOT = "aoi2022"
SOFT = ["--set", "springs.stiffness[0]=15 N*mm/deg"]


def test_a_walk_in_three_dimensions(capsys, tmp_path):
    file = tmp_path / "walk.nc"
    arguments = ["walk", ROBOT, *SOFT, "--engine", "twin", "--duration", "6 s", "--seed", "3", "--repeats", "2"]
    found = printed(*arguments, "--forces", "--out", str(file), "--json")
    assert found["engine"] == "twin"
    assert found["foot_creep_N_s_m"] > 100.0
    assert [walk["status"] for walk in found["walks"]] == ["walked", "walked"]
    with xr.open_dataset(file, engine="h5netcdf") as record:
        assert record.attrs["engine"] == "twin"
        load = record.foot_load.sum(("module", "side")).mean()
        assert float(load) == pytest.approx(8.5 * 9.81, rel=0.02)
    assert main(arguments) == 0
    assert "feet creep like viscous ones of 4100 N*s/m" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (
            ["walk", "aoi2022-planar", "--engine", "twin"],
            "must be given in the robot file for the three-dimensional model",
        ),
        (["walk", ROBOT, "--engine", "twn"], "did you mean 'twin'?"),
        (["walk", ROBOT, "--engine", "twin", "--set", "twin.hip_height=130 mm"], "cannot reach its path"),
        (["walk", ROBOT, "--engine", "twin", "--set", "twin.link_mass=1 kg"], "must leave mass for the body"),
        (["walk", ROBOT, "--engine", "twin", "--set", "twin.servo_stiffness=0 N*m/rad"], "must be positive"),
        (["walk", ROBOT, "--engine", "twin", "--set", "twin.timestep=0.003 s"], "must divide twin.control_interval"),
        (["identify", "twin", "aoi2022-planar"], "[twin]"),
    ],
)
def test_what_cannot_walk_is_refused_in_one_line(capsys, arguments, complaint, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    message = capsys.readouterr().err.splitlines()[-1]
    assert message.startswith("error: ")
    assert complaint in message


def test_a_turn_does_not_walk_its_law_anew(tmp_path, monkeypatch):
    law = importlib.import_module("chilopod.tasks.radius_law")
    monkeypatch.setattr(law, "bent", partial(law.bent, cycles=25.0))
    arguments = ["turn", ROBOT, "--engine", "twin", "--target", "45 deg, 1.3 m", "--k1", "law", "--duration", "2 s"]
    first = printed(*arguments, "--trials", str(tmp_path), "--json")
    kept = {file.name: file.stat().st_mtime_ns for file in tmp_path.iterdir()}
    assert len(kept) == 9 + 1
    other = [*arguments[:5], "40 deg, 1.5 m", *arguments[6:]]
    assert printed(*other, "--trials", str(tmp_path), "--json")["spring_by_law_N_m_rad"] > 0.0
    assert {name: (tmp_path / name).stat().st_mtime_ns for name in kept} == kept
    assert len(list(tmp_path.iterdir())) == 9 + 2
    assert printed(*arguments, "--trials", str(tmp_path), "--json") == first


def test_a_robot_that_blows_up_says_so():
    found = printed("walk", ROBOT, "--engine", "twin", "--duration", "2 s", "--json",
        "--set", "twin.servo_stiffness=9000 N*m/rad", "--set", "twin.servo_damping=1e-6 N*m*s/rad",
    )  # fmt: skip
    assert found["walks"][0]["status"] == "diverged"


def test_identify_twin_keeps_what_it_has_tried(capsys, tmp_path, monkeypatch):
    bends = base_series_data().start(load_robot(ROBOT), base_series_data().springs)
    asked = []

    def series(robot, data):
        asked.append(robot)
        return Series(bends, bends, np.full(7, 0.056))

    monkeypatch.setattr(twin, "base_series", series)
    monkeypatch.setattr(twin, "confirmed", lambda robot, springs: True)
    arguments = ["identify", "twin", "--out", str(tmp_path), "--evaluations", "5", "--samples", "5", "--json"]
    found = printed(*arguments)
    count = 10
    assert found["robot"] == ROBOT
    assert found["evaluations"] == len(asked) == count
    assert main(arguments) == 2
    assert "--force" in capsys.readouterr().err
    assert found == printed(*arguments, "--force")
    assert len(asked) == count
    assert load_robot(tmp_path / "identified.toml").get("legs.half_width") == pytest.approx(
        found["constants"]["legs.half_width"]["value_si"]
    )
