"""`chilopod size` as a user and as a hostile user meet it."""

import json

import pytest

from chilopod.robot import load_robot
from helpers.command_line import remarks, run

SPRING = ("--free", "springs.stiffness[0]=5..60 N*mm/deg")


def test_a_table_files_and_a_robot(tmp_path):
    arguments = ("size", "aoi2022-planar", "--growth", "-0.1 1/s", *SPRING)
    code, out, _ = run(*arguments)
    assert code == 0
    assert out.splitlines()[0] == "aoi2022-planar: every wish is met"
    code, out, _ = run(*arguments, "--json", "--out", str(tmp_path / "s"))
    assert (code, json.loads(out)) == (0, json.loads((tmp_path / "s" / "size.json").read_text()))
    spring = json.loads(out)["numbers_si"]["springs.stiffness[0]"]
    assert load_robot(tmp_path / "s" / "sized.toml").springs.stiffness[0] == spring
    code, _, err = run(*arguments, "--out", str(tmp_path / "s"))
    assert code == 2
    assert "--force" in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (SPRING, "--radius or --speed or"),
        (("--radius", "1 kg", *SPRING), "--radius = '1 kg': is a mass"),
        (("--radius", "1 m", "--free", "springs.stiffness[0]=5 60"), "must be a number with its range"),
        (("--radius", "1 m", "--free", "springs.stiffness[0]=60..5 N*mm/deg"), "must rise"),
        (("--radius", "1 m", "--free", "springs.stifness=5..60 N*mm/deg"), "did you mean 'springs.stiffness'?"),
        (("--radius", "1 m", "--free", "body.mass=-1..60 kg"), "--free body.mass = "),
        (("--radius", "1 m", "--twin", *SPRING), "needs a table [twin]"),
        (("--radius", "1 m"), "Missing option '--free'"),
    ],
)
def test_mistakes_are_named_in_one_line(arguments, said):
    code, out, err = run("size", "aoi2022-planar", *arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert len([line for line in remarks(err) if line.startswith("error:")]) == 1


def test_a_range_without_a_unit_is_said():
    code, _, err = run("size", "aoi2022-planar", "--margin", "1 m", "--free", "springs.stiffness[0]=1..2")
    assert code == 2
    assert "a number without a unit is SI: --free springs.stiffness[0] is 1 N*m/rad to 2 N*m/rad, that is 17.45" in err


def test_an_option_that_is_given_twice_is_refused():
    code, out, err = run(
        "size", "aoi2022-planar", "--speed", "<0.1 m/s", "--speed=>0.2 m/s", "--free", "speed=0.05..0.3 m/s"
    )
    assert (code, out) == (2, "")
    assert err.strip() == "error: --speed: must be given once"
