"""``chilopod course`` as it is typed."""

import pytest
import xarray as xr

from chilopod.cli import main
from chilopod.steering import COURSES, ON_COURSES
from helpers.command_line import printed

ROBOT = "aoi2022-planar"
# A robot that has no radius law, which takes longest.
WIDE = [ROBOT, "--set", "legs.half_width=0.3 m", "--strategy", "leg-yaw"]
AHEAD = ["--targets", "0 deg, 0.25 m; 0 deg, 99 m; 5 deg, 0.25 m"]


def test_text_json_and_files_tell_the_same(capsys, tmp_path):
    found = printed("course", *WIDE, *AHEAD, "--patience", "9 s", "--json", "--out", tmp_path / "new")
    assert (found["robot"], found["strategy"], found["patience_s"]) == (ROBOT, "leg-yaw", 9.0)
    (walk,) = found["walks"]
    assert (walk["seed"], walk["status"], walk["arrived"]) == (None, "halted", 2)
    assert [goal["verdict"] for goal in walk["targets"]] == ["arrived", "out of reach", "arrived"]
    assert list(walk["targets"][0]) == [
        *("verdict", "sentence", "place_m", "begin_s", "end_s", "nearest_m", "path_m", "shortest_m"),
        *("leg_yaw_effort_rad2_s", "spring_work_J", "drive_work_J"),
    ]
    files = {file.name for file in (tmp_path / "new").iterdir()}
    assert files >= {"course.png", "course.svg", "course.nc", "course.html"}
    with xr.open_dataset(tmp_path / "new" / "course.nc", engine="h5netcdf") as record:
        assert record.goal_verdict.values[0].tolist() == [goal["verdict"] for goal in walk["targets"]]

    assert main(["course", *WIDE, *AHEAD, "--patience", "9 s"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1:3] == [
        "  3 targets, 9 s for each",
        "  how tightly the robot turns is not known, so shortest paths are straight lines: the straight walk has no "
        "pitchfork in this interval",
    ]
    first = walk["targets"][0]
    assert lines[4].split()[:5] == ["1", "arrived", f"{first['end_s']:.1f}", f"{first['path_m']:.2f}", "/"]
    assert lines[5].split() == ["2", "out", "of", "reach", *"-----"]
    assert lines[7] == "  out of reach: farther than the robot can walk in its time"
    assert lines[8].startswith(f"  2 of 3 targets in {walk['time_s']:.1f} s; work 0 J on springs")


def test_of_several_walks_there_is_a_line_each(capsys):
    assert main(["course", *WIDE, "--targets", "0 deg, 0.25 m", "--seed", "3", "--repeats", "2"]) == 0
    *_, heads, one, other, last = capsys.readouterr().out.splitlines()
    assert heads.split()[:2] == ["seed", "targets"]
    assert [line.split()[:4] for line in (one, other)] == [["3", "1", "of", "1"], ["4", "1", "of", "1"]]
    assert last == "  2 of 2 targets, 2 of 2 courses whole"


def test_the_help_has_all_choices(capsys):
    assert main(["course", "--help"]) == 0
    shown = capsys.readouterr().out
    assert f"|{'|'.join(COURSES)}|random:SEED" in shown
    assert "|".join(ON_COURSES) in shown


@pytest.mark.parametrize(
    ("more", "start"),
    [
        (["--targets", ""], "--targets = '': must be targets, a named course or an existing file"),
        (
            ["--targets", "slalmo"],
            "--targets = 'slalmo': must be targets, a named course or an existing file; did you mean 'slalom'?",
        ),
        (["--targets", "1 m, 0 m; 1 m, 0 m"], "--targets 2 = '1 m, 0 m': must lie apart from target 1"),
        (["--targets", "0 deg, 1e9 m"], "--targets 1 = '1e+09 m': must be a distance"),
        (["--targets", "many.txt"], "many.txt: too large for a course"),
        (
            ["--targets", "some.txt"],
            "some.txt: --targets = 'some.txt': must be a number of targets; allowed: 1 to 1000",
        ),
        (["--strategy", "pitchfrok"], "--strategy = 'pitchfrok': must be a strategy; did you mean 'pitchfork'?"),
        (["--k1", "15 N*mm/deg"], "--k1 = '15 N*mm/deg': must not be given: strategy variable sets its own springs"),
        (["--k1", "15 N*mm/deg", "--targets", "slalmo"], "--k1 = '15 N*mm/deg': must not be given"),
        (["--strategy", "pitchfork"], "--k1: strategy pitchfork needs one stiffness"),
        (["--strategy", "hopf", "--k1", "-3"], "--k1 = '-3': must be positive"),
        (["--patience", "0 s"], "--patience = '0 s': is out of range"),
        (["--repeats", "2"], "--repeats = 2: must be 1 without a seed"),
        (["--repeats", "33333", "--seed", "1", "--patience", "1e4 s"], "record: would take "),
        (["--set", "springs.adjustable=false"], "springs.adjustable[0] = False: must be true"),
        (["--set", "legs.half_width=0.3 m"], "strategy variable needs a radius law of the first spring"),
        (["--engine", "twin"], "--engine = 'twin': the table [twin] must be given in the robot file"),
    ],
)
def test_what_cannot_be_walked_is_one_line(capsys, monkeypatch, tmp_path, more, start):
    monkeypatch.chdir(tmp_path)
    for name, count in (("many.txt", 10**6), ("some.txt", 1001)):
        if name in more:
            (tmp_path / name).write_text("10 deg, 1 m\n" * count)
    targets = [] if "--targets" in more else ["--targets", "0 deg, 0.5 m"]
    assert main(["course", ROBOT, *targets, *more]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.splitlines()[-1].startswith(f"error: {start}")
