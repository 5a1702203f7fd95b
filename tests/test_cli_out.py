"""Results of one's own are never lost: `--out` replaces nothing without `--force`; and every JSON names its robot."""

import json

import pytest

from chilopod.cli import main

ROBOT = "aoi2022-planar"
INTERVAL = ["--between", "11 N*mm/deg", "13 N*mm/deg"]
COMMANDS = {
    "stability.json": ["stability", ROBOT],
    "bifurcation.json": ["bifurcation", ROBOT, "--parameter", "springs.stiffness[0]", *INTERVAL],
    "branch.csv": ["branch", ROBOT, *INTERVAL, "--points", "2"],
    "identification.svg": ["identify", "planar", "--points", "3"],
    "identified.toml": ["identify", "twin"],
    "turn.html": ["turn", ROBOT, "--target", "45 deg, 1.3 m", "--k1", "10 N*mm/deg", "--duration", "1 s"],
}


@pytest.mark.parametrize(("name", "arguments"), COMMANDS.items(), ids=COMMANDS)
def test_a_file_of_any_command_is_only_replaced_if_told(capsys, tmp_path, name, arguments):
    file = tmp_path / name
    file.write_text("precious")
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == f"error: {file}: exists and is only replaced with --force\n"
    assert file.read_text() == "precious"
    assert [each.name for each in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("name", ["stability.json", "bifurcation.json", "branch.csv", "turn.html"])
def test_what_is_forced_is_replaced_and_the_json_names_the_robot(capsys, tmp_path, name):
    (tmp_path / name).write_text("old")
    assert main([*COMMANDS[name], "--out", str(tmp_path), "--force", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["robot"] == ROBOT
    assert (tmp_path / name).read_text(encoding="utf-8") != "old"
