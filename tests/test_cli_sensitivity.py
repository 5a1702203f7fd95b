"""`chilopod sensitivity` as a user and as a hostile user meet it."""

import json
from itertools import permutations

import pytest

from chilopod import load_robot
from chilopod.analysis.parameters import stiffness
from chilopod.cli.studies import _tolerances
from helpers.command_line import remarks, run

PRESET = "aoi2022-planar"


def test_a_table_and_the_same_as_json(tmp_path):
    code, out, err = run("sensitivity", PRESET, "--show", "onset")
    assert (code, remarks(err)) == (0, [])
    assert out.splitlines()[0] == "aoi2022-planar: onset 11.991 N*mm/deg (bends)"
    assert out.splitlines()[2].split()[:3] == ["gait.module_phase", "120", "deg"]
    code, out, err = run("sensitivity", PRESET, "--show", "onset", "--json", "--out", str(tmp_path / "new"))
    assert code == 0
    assert json.loads(out) == json.loads((tmp_path / "new" / "sensitivity.json").read_text())
    assert (tmp_path / "new" / "sensitivity.png").stat().st_size > 10_000
    code, _, err = run("sensitivity", PRESET, "--out", str(tmp_path / "new"))
    assert code == 2
    assert "--force" in err


def test_tolerances_of_all_numbers_and_of_one():
    arguments = ("--uncertain", "ground.friction=5%", "--uncertain", "body.mass=0.3 kg", "--samples", "16", "--json")
    code, out, _ = run("sensitivity", PRESET, *arguments)
    found = json.loads(out)
    assert (code, found["evaluations"], found["failed"]) == (0, 64, 0)
    assert found["numbers"]["body.mass"]["tolerance_si"] == 0.3
    assert found["numbers"]["ground.friction"]["tolerance_si"] == pytest.approx(0.05 * 246.5)
    assert 0.0 < found["deviation_sampled_si"] < 0.1 * found["onset_si"]


def test_tolerances_of_a_group_of_springs_that_differ():
    arguments = ("--set", "springs.stiffness[4]=60 N*mm/deg", "--uncertain", "springs.stiffness[3:]=20%")
    code, out, _ = run("sensitivity", PRESET, *arguments, "--samples", "16", "--json")
    found = json.loads(out)["numbers"]
    assert (code, [*found]) == (0, ["springs.stiffness[3]", "springs.stiffness[4]"])
    assert [each["tolerance_si"] for each in found.values()] == pytest.approx([stiffness(8.2), stiffness(12.0)])


def test_the_tolerance_of_a_number_goes_before_those_of_its_group_and_of_all():
    tolerances = "10%", "springs.stiffness[1:]=4%", "springs.stiffness[2]=2%"
    found = [_tolerances(load_robot(PRESET), "springs.stiffness[0]", [*each]) for each in permutations(tolerances)]
    assert all([*each.items()] == [*found[0].items()] for each in found)
    shares = [found[0][f"springs.stiffness[{i}]"] / stiffness(41.0) for i in range(1, 5)]
    assert shares == pytest.approx([0.04, 0.02, 0.04, 0.04])
    assert found[0]["body.mass"] == pytest.approx(0.1 * load_robot(PRESET).body.mass)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--show", "onst"), "--show = 'onst': is not known; did you mean 'onset'?"),
        (("--show", "radius"), "springs.stiffness[0] = '41 N*mm/deg': the straight walk is stable there"),
        (("--at", "3 kg"), "--at = '3 kg': is a mass"),
        (("--uncertain", "10"), "--uncertain = '10': must be a share, or a number with its tolerance"),
        (("--uncertain", "x%"), "must be a share"),
        (("--uncertain", "body.mass=0 kg"), "--uncertain = 'body.mass=0 kg': must be positive"),
        (("--uncertain", "body.mass=1%", "--uncertain", "body.mass=2%"), "must be given once"),
        (("--uncertain", "1%", "--uncertain", "2%"), "--uncertain = '2%': must be given once"),
        (
            ("--uncertain", "springs.stiffness[1:]=1%", "--uncertain", "springs.stiffness[2:4]=2%"),
            "must be given once; allowed: one tolerance of springs.stiffness[2]",
        ),
        (("--samples", "32"), "--samples = 32: goes with --uncertain only"),
        (("--seed", "0"), "--seed = 0: goes with --uncertain only"),
        (("--show", ""), "--show = '': is not known"),
        (
            ("--show", "coefficient", "--set", "gait.side_phase=170 deg"),
            "N*mm/deg': the onset has no cubic coefficient: its kind is transcritical",
        ),
        (
            ("--show", "radius", "--at", "4 N*mm/deg"),
            "springs.stiffness[0] = '4 N*mm/deg': the curved walk bends a joint by more than a right angle",
        ),
        (
            ("--show", "radius", "--parameter", "springs.stiffness", "--at", "6 N*mm/deg"),
            "error: springs.stiffness = '6 N*mm/deg to 77.44 N*mm/deg': the straight walk has no pitchfork",
        ),
        (("--uncertain", "body.mas=10%"), "did you mean 'body.mass'?"),
        (("--uncertain", "body.mass=1 cm"), "is a length"),
        (("--uncertain", "inf%"), "--uncertain = 'inf%': must be a share above 0 % and below 100 %"),
        (("--uncertain", "150%"), "--uncertain = '150%': must be a share above 0 % and below 100 %"),
        (("--uncertain", "body.mass=20 kg"), "body.mass = -11.5"),
        (("--uncertain", "springs.damping[0]=0.001"), "springs.damping[0] = -0.001"),
        (
            ("--set", "springs.damping=0.02", "--uncertain", "springs.damping[0]=0.05"),
            "--uncertain = 'springs.damping[0]=0.05': springs.damping[0] = -0.03 N*m*s/rad: must not be negative",
        ),
        (("--uncertain", "springs.damping=10%"), "is 0, which has no share"),
        (("--uncertain", "5%", "--show", "growth"), "goes without --uncertain only"),
        (("--uncertain", "springs.stiffness[0]=10%"), "must not be the number whose critical value is searched"),
        (("--uncertain", "10%", "--samples", "100"), "must be a power of two"),
        (
            ("--between", "20 N*mm/deg", "75 N*mm/deg"),
            "'20 N*mm/deg to 75 N*mm/deg': no loss of stability in the interval",
        ),
        (("--parameter", "body.modules", "--between", "3", "8"), "must be a continuous parameter"),
    ],
)
def test_mistakes_are_named_in_one_line(arguments, said):
    code, out, err = run("sensitivity", PRESET, *arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert len(remarks(err)) <= 1
