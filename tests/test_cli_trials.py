"""``chilopod trials``: what is in a folder of trials, whether it is whole, and what may go."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from chilopod import load_robot
from chilopod.cli import main
from chilopod.cli.trials import _cells
from chilopod.steering import Course, Goal, LegYawController, Target
from chilopod.trials import NONE, Store, Trial, claims, run, trial
from chilopod.trials.folder import Kept, groups

ROBOT = load_robot("aoi2022-planar")
SOFT = ROBOT.set_from_text(["springs.stiffness[0]=12 N*mm/deg"])
BASE = Trial(ROBOT, 0.5, rate=20.0)
TRIALS = [replace(BASE, robot=robot, seed=seed) for robot in (ROBOT, SOFT) for seed in (1, 2, 4)]
TRIALS += [replace(BASE, target=Target(0.5, 2.0), controller=LegYawController(), disturbance=NONE)]


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walked")
    run(TRIALS, folder)
    return folder


@pytest.fixture
def folder(walked, tmp_path):
    return shutil.copytree(walked, tmp_path / "kept")


@pytest.fixture
def printed(capsys):
    """Of a command: its exit code, and what it printed, as JSON too."""

    def call(*arguments):
        codes = [main(["trials", *map(str, arguments), *more]) for more in ([], ["--json"])]
        text = capsys.readouterr().out
        assert codes[0] == codes[1]
        at = text.index("\n{\n") if "\n{\n" in text else 0
        return codes[0], text[:at].splitlines(), json.loads(text[at:])

    return call


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_list_groups_what_differs_in_robots_and_seeds(folder, printed):
    (folder / "notes.txt").touch()
    code, lines, found = printed("list", folder)
    assert code == 0
    assert " ".join(lines[1].split()).startswith("aoi2022-planar planar 0.5 s 28.65 deg, 2 m LegYawController 1 - 1 ")
    assert " 2       1-2, 4  6 " in lines[2]
    assert lines[3].startswith("7 trials, ")
    assert lines[4] == "1 file of no trial"
    groups = [(group["robots"], group["seeds"], group["trials"]) for group in found["groups"]]
    assert groups == [(1, "", 1), (2, "1-2, 4", 6)]
    assert found["foreign"] == ["notes.txt"]


def test_trials_of_a_changed_controller_are_rows_of_their_own():
    shared = {"engine": "planar", "duration": 1.0, "seed": 1, "controller": {"class": "mine:Mine"}}
    rows = groups([Kept(Path(), 1, "robot", {**shared, "code": each}, True) for each in ("1a2b3c4d", "5e6f7a8b")])
    assert [_cells(row)[4] for row in rows] == ["Mine (code 1a2b3c)", "Mine (code 5e6f7a)"]


def test_a_list_says_how_many_targets_courses_have(tmp_path, printed):
    goals = (Goal(1.0, 0.0, relative=True), Goal(1.0, 0.5, relative=True))
    run([replace(BASE, target=Course(each, 0.5), duration=0.5 * len(each)) for each in (goals, goals[:1])], tmp_path)
    _, lines, found = printed("list", tmp_path)
    assert ["course of 1" in lines[1], "course of 2" in lines[2]] == [True, True]
    assert [(group["target"], group["targets"]) for group in found["groups"]] == [(None, 1), (None, 2)]


def test_a_check_names_what_is_not_whole(folder, printed):
    assert printed("check", folder)[:2] == (0, ["7 trials whole, 0 not"])
    one, other, third = (folder / each.file_name for each in TRIALS[:3])
    one.write_bytes(one.read_bytes()[:-1] + b"x")
    shutil.copy(third, other)
    code, lines, found = printed("check", folder)
    assert code == 2
    assert f"{one} is damaged or was edited, or chilopod did not write it" in lines
    assert f"{other} holds another trial, whose name ends in {third.name[-23:]}" in lines
    assert lines[-1] == "5 trials whole, 2 not"
    assert {each["file"] for each in found["wrong"]} == {one.name, other.name}


def test_trials_of_another_version_are_whole_and_go_if_asked(folder, printed, monkeypatch):
    monkeypatch.setattr(trial, "digest", lambda without: "0" * 64)
    new = replace(TRIALS[0])
    run([new], folder)
    (line,) = printed("check", folder)[1]
    assert line == "8 trials whole, 0 not; 7 of another version, which this one does not find"
    assert "another version" in printed("list", folder)[1][1]
    assert main(["trials", "clean", str(folder)]) == 0
    assert len(names(folder)) == 8
    assert main(["trials", "clean", str(folder), "--old"]) == 0
    assert names(folder) == [new.file_name]


def test_cleaning_removes_what_is_of_no_use_and_nothing_else(folder, printed):
    path = folder / TRIALS[0].file_name
    path.write_bytes(b"")
    assert Store(folder, lambda line: None).read(TRIALS[0]) is None
    foreign = [folder / "notes.txt", folder / "notes.nc.aside", folder / f"{path.name}.aside2"]
    for each in foreign[:2]:
        each.touch()
    foreign[2].mkdir()
    ours = [folder / f"{path.name}.aside", folder / ".chilopod-trial-x", folder / claims.NAME]
    ours[1].touch()
    before = names(folder)
    with Store(folder).claims():
        assert "a process is walking here" in printed("clean", folder, "--dry-run")[1][-2]
    ours[1].touch()
    ours[2].touch()
    code, lines, found = printed("clean", folder, "--dry-run")
    assert (code, found["removed"], len(found["left"])) == (0, [ours[0].name, ours[2].name, ours[1].name], 3)
    assert f"would remove {ours[0]}" in lines
    assert names(folder) == sorted({*before, claims.NAME})
    assert main(["trials", "clean", str(folder)]) == 0
    assert set(before) - set(names(folder)) == {each.name for each in ours} & set(before)
    assert all(each.exists() for each in foreign)


@pytest.mark.parametrize("command", ["list", "check", "clean"])
def test_what_is_no_folder_is_refused_in_one_line(command, tmp_path, capsys):
    (tmp_path / "file").touch()
    for name, why in (("nosuch", "No such file"), ("file", "Not a directory")):
        assert main(["trials", command, str(tmp_path / name)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("error: folder = ")
        assert why in line
    assert names(tmp_path) == ["file"]
