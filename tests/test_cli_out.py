"""Results are never lost, one's own by `--out` without `--force` neither; and every JSON names its robot."""

import errno
import json
import os
from types import SimpleNamespace

import pytest

from chilopod.cli import main
from chilopod.cli.options import deliver
from chilopod.errors import OutputError
from chilopod.output import write_all
from chilopod.robot import load_robot

ROBOT = "aoi2022-planar"
FULL = "cannot be written (No space left on device)"
INTERVAL = ["--between", "11 N*mm/deg", "13 N*mm/deg"]
COMMANDS = {
    "stability.json": ["stability", ROBOT],
    "bifurcation.json": ["bifurcation", ROBOT, "--parameter", "springs.stiffness[0]", *INTERVAL],
    "branch.csv": ["branch", ROBOT, *INTERVAL, "--points", "2"],
    "identification.svg": ["identify", "planar", "--points", "3"],
    "identified.toml": ["identify", "twin"],
    "turn.html": ["turn", ROBOT, "--target", "45 deg, 1.3 m", "--k1", "10 N*mm/deg", "--duration", "1 s"],
    "course.html": ["course", ROBOT, "--targets", "0 deg, 0.5 m"],
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


@pytest.mark.parametrize(
    "arguments",
    [
        ["walk", ROBOT, "--engine", "bogus", "--out", "a/b/c.nc", "--trials", "t"],
        ["walk", ROBOT, "--rate", "0", "--out", "a/c.nc", "--trials", "t/u"],
        ["walk", ROBOT, "--seed", "1", "--repeats", "1000", "--duration", "1e5 s", "--rate", "1e6", "--out", "a/c.nc"],
        ["walk", ROBOT, "--out", "/dev/null", "--force", "--trials", "t"],
        ["branch", ROBOT, "--resume", "nosuch", "--out", "new"],
        ["branch", ROBOT, "--parameter", "nosuch", "--out", "new"],
        ["turn", ROBOT, "--target", "45 deg, 1.3 m", "--k1", "0 N*mm/deg", "--out", "a/b", "--trials", "t"],
        ["bifurcation", ROBOT, "--parameter", "nosuch", "--between", "1", "2", "--out", "a"],
        ["stability", "nosuch", "--out", "a"],
        ["identify", "twin", ROBOT, "--out", "a"],
        ["reproduce", "--only", "nosuch", "--out", "a"],
        ["robot", "new", "a/b.toml", "--modules", "0"],
        ["robot", "export", ROBOT, "--out", "a/b.xml"],
    ],
)
def test_what_is_refused_leaves_nothing(capsys, tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("error: ")) == ("", 1)
    assert err.splitlines()[-1].startswith("error: ")
    assert os.listdir(tmp_path) == []


@pytest.fixture
def full_there(monkeypatch, tmp_path):
    """The folder `there` lies on a full disk, the current one does not."""
    real = os.replace

    def full(source, target):
        if "there" in str(target):
            raise OSError(errno.ENOSPC, "No space left on device")
        real(source, target)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(os, "replace", full)
    return tmp_path


def test_a_file_of_a_full_disk_is_kept_elsewhere(capsys, full_there):
    (full_there / "there").mkdir()
    assert main(["robot", "new", "there/robot.toml"]) == 2
    assert capsys.readouterr().err.endswith(f"(No space left on device); kept instead: {full_there / 'robot.toml'}\n")
    assert os.listdir(full_there / "there") == []


def test_every_file_of_a_sized_robot_is_kept_elsewhere(capsys, full_there, monkeypatch):
    robot = load_robot(ROBOT).override("body.mass", "9 kg")
    found = SimpleNamespace(
        robot=robot, as_json=lambda: {"robot": ROBOT}, lines=lambda: ["met"], plot=lambda axes: axes
    )
    monkeypatch.setattr("chilopod.tasks.size", lambda *_, **__: found)
    assert main(["size", ROBOT, "--margin", "0.2", "--free", "body.mass=5..10 kg", "--out", "there"]) == 2
    out, err = capsys.readouterr()
    names = "sized.toml", "size.json", "size.svg", "size.png"
    assert (out, sorted(os.listdir())) == ("met\n", sorted(names))
    kept = ", ".join(str(full_there / name) for name in names)
    assert err.splitlines()[-1].endswith(
        f"sized.toml: cannot be written (No space left on device); kept instead: {kept}"
    )
    assert load_robot(full_there / "sized.toml") == robot


def test_a_map_goes_on_without_its_growth_rates_and_every_file_is_kept_elsewhere(capsys, full_there, caplog):
    axes = "--x", "springs.stiffness[0]", "1.9", "2", "--y", "legs.half_width", "70 mm", "80 mm"
    assert main(["map", ROBOT, *axes, "--points", "2", "--show", "kind", "--out", "there", "--json"]) == 2
    out, err = capsys.readouterr()
    names = "map.json", "map.nc", "map.csv", "map-curves.csv", "map.svg", "map.png"
    assert sorted(os.listdir()) == sorted(names)
    assert json.loads(out) == json.loads((full_there / "map.json").read_text())
    kept = ", ".join(str(full_there / name) for name in names)
    assert err.splitlines()[-1].endswith(f"map.json: {FULL}; kept instead: {kept}")
    (said,) = [each.getMessage() for each in caplog.records if each.name == "chilopod.output"]
    assert said == f"there: growth rates are not kept: {FULL}"


def test_files_that_could_be_written_are_named_too(capsys, full_there, monkeypatch):
    without = os.replace
    monkeypatch.setattr(os, "replace", lambda *to: (os.rename if to[1].suffix == ".svg" else without)(*to))
    (full_there / "there").mkdir()
    files = [(full_there / "there" / each, "1") for each in ("a.nc", "b.svg")]
    with pytest.raises(OutputError, match="kept instead"):
        deliver(lambda: write_all(files), lambda: print("the result"))
    assert capsys.readouterr() == ("the result\n", f"wrote {files[1][0]}\n")


def test_trials_that_a_full_disk_does_not_keep_are_printed_and_said_once(capsys, tmp_path, monkeypatch, caplog):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    folder = tmp_path / "trials"
    assert main(["turn", ROBOT, "--target", "45 deg, 1.3 m", "--trials", str(folder)]) == 0  # of several studies
    assert "spring by the settled radius" in capsys.readouterr().out
    told = [each.getMessage() for each in caplog.records if each.name == "chilopod.trials.store"]
    assert told == [f"{folder}: trials run but are not kept: cannot be written (No space left on device)"]


def test_one_size_of_the_report(capsys):
    assert main(["reproduce", "--quick", "--all"]) == 2
    assert "must be given alone; allowed: one of" in capsys.readouterr().err


def test_the_option_of_several_values_names_the_wrong_one(capsys):
    assert main(["reproduce", "--only", "mode", "--only", "nosuch"]) == 2
    assert capsys.readouterr().err.startswith("error: --only = 'nosuch': must be a section")


@pytest.mark.parametrize(
    "arguments",
    [["walk", ROBOT, "--duration", "1 s", "--out", "there/walks.nc"], ["stability", ROBOT, "--out", "there"]],
)
def test_what_cannot_be_written_is_printed_all_the_same(capsys, tmp_path, monkeypatch, arguments):
    real = os.replace

    def full(source, target):
        if ".chilopod-" in str(source):
            raise OSError(errno.ENOSPC, "No space left on device")
        real(source, target)  # of compiled code

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(os, "replace", full)
    assert main([*arguments, "--json"]) == 2
    out, err = capsys.readouterr()
    assert json.loads(out)["robot"] == ROBOT
    last = err.splitlines()[-1]
    assert last.startswith("error: there/")
    assert last.endswith("cannot be written (No space left on device); no other place could be written")
    assert os.listdir(tmp_path) == []
