"""``chilopod robot export``."""

import json
import os

import mujoco
import pytest

from chilopod import load_robot
from chilopod.twin import TwinModel
from helpers.command_line import remarks, run


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_suffix_chooses_the_format(folder):
    assert run("robot", "export", "aoi2022", "--out", "robot.xml") == (0, "wrote robot.xml: MJCF\n", "")
    assert mujoco.MjModel.from_xml_path("robot.xml").nu == 26
    code, out, err = run("robot", "export", "aoi2022", "--out", "robot.urdf", "--json", "--set", "body.modules=3")
    assert (code, remarks(err)) == (0, [])
    assert json.loads(out) == {"robot": "aoi2022", "file": "robot.urdf", "format": "URDF"}
    assert mujoco.MjModel.from_xml_path("robot.urdf").njnt == 2 + 4 * 3 + 2
    assert sorted(os.listdir(folder)) == ["robot.urdf", "robot.xml"]


def test_overrides_are_in_the_file():
    assert run("robot", "export", "aoi2022", "--out", "soft.xml", "--set", "springs.stiffness[0]=12 N*mm/deg")[0] == 0
    soft = load_robot("aoi2022").set_from_text(["springs.stiffness[0]=12 N*mm/deg"])
    stiffness = mujoco.MjModel.from_xml_path("soft.xml").jnt_stiffness
    assert stiffness.tolist() == TwinModel(soft).model.jnt_stiffness.tolist()


def test_a_file_is_only_replaced_when_told(folder):
    (folder / "robot.xml").write_text("precious")
    code, out, err = run("robot", "export", "aoi2022", "--out", "robot.xml")
    assert (code, out) == (2, "")
    assert "robot.xml: exists" in err
    assert (folder / "robot.xml").read_text() == "precious"
    assert run("robot", "export", "aoi2022", "--out", "robot.xml", "--force")[0] == 0
    assert "<mujoco" in (folder / "robot.xml").read_text()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["aoi2022"], "--out"),
        (["aoi2022", "--out", "robot.obj"], ".urdf (URDF)"),
        (["aoi2022", "--out", "robot"], ".xml (MJCF)"),
        (["aoi2022-planar", "--out", "robot.xml"], "the preset aoi2022"),
        (["aoi2022", "--out", "robot.xml", "--set", "twin.hip_height=13 cm"], "cannot reach"),
        (["aoi2022", "--out", "robot.xml", "--set", "twin.hip_hight=9 cm"], "did you mean 'twin.hip_height'?"),
        (["aoi2022", "--out", "robot.xml", "--set", "twin.link_mass=1 kg"], "must leave mass for the body"),
        (["aoi2022", "--out", "robot.urdf", "--set", "twin.foot_radius=1e-8 m"], "larger than mjMINVAL"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(folder, arguments, complaint):
    code, out, err = run("robot", "export", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.removesuffix("\n").isprintable()
    assert complaint in err
    assert os.listdir(folder) == []
