"""``chilopod walk`` and ``chilopod turn`` as they are typed."""

import json
import os
import sys

import numpy as np
import pytest
import xarray as xr

from chilopod import planar, twin
from chilopod.cli import main
from chilopod.cli.options import EngineOption
from chilopod.engine import ENGINES
from chilopod.record import RATE
from chilopod.steering import ARRIVAL_RADIUS, STRATEGIES
from helpers.command_line import printed, run

ROBOT = "aoi2022-planar"
SOFT = ["--set", "springs.stiffness[0]=9 N*mm/deg"]
TURN = ["turn", "--target", "45 deg, 1.3 m"]
THERE = ["turn", ROBOT, "--target", "45 deg, 1 m"]


def refused(*arguments):
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    message = err.splitlines()[-1]
    assert message.startswith("error: ")
    return message


def test_walk_writes_its_record_and_never_over_another(tmp_path):
    file = tmp_path / "walks" / "a.nc"
    arguments = ["walk", ROBOT, *SOFT, "--duration", "6 s", "--rate", "10", "--out", str(file)]
    found = printed(*arguments, "--seed", "5", "--repeats", "3", "--forces", "--json")
    assert [walk["seed"] for walk in found["walks"]] == [5, 6, 7]
    assert {walk["status"] for walk in found["walks"]} == {"walked"}
    with xr.open_dataset(file, engine="h5netcdf") as record:
        assert record.sizes["robot"] == 3
        assert record.sizes["time"] == 61
        assert record.foot_force.attrs["units"] == "N"
        angles = record.joint_angle.sel(time=slice(1.05, 6.05)).mean("time")
        listed = [walk["mean_joint_angles_rad"] for walk in found["walks"]]
        np.testing.assert_allclose(angles, listed, rtol=0, atol=1e-12)
    kept = file.read_bytes()
    assert "--force" in refused(*arguments)
    assert file.read_bytes() == kept
    assert main([*arguments, "--force"]) == 0
    assert file.read_bytes() != kept


def test_the_same_seed_walks_the_same_way_and_no_seed_undisturbed():
    arguments = ["walk", ROBOT, *SOFT, "--duration", "3 s", "--json"]
    assert printed(*arguments, "--seed", "1") == printed(*arguments, "--seed", "1")
    assert printed(*arguments, "--seed", "1") != printed(*arguments, "--seed", "2")
    straight = printed(*arguments)["walks"][0]
    assert straight["axis_radius_m"] is None
    assert straight["y_m"] == 0.0
    assert straight["x_m"] == pytest.approx(3.0 * 0.03 / 0.31)


def test_walk_prints_a_line_a_walk(capsys):
    assert main(["walk", ROBOT, *SOFT, "--initial-joints", "2,0,0,0,0 deg", "--duration", "1 min"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert len(out) == 3
    assert "1 walk of 60 s" in out[0]
    angles = [float(word) for word in out[2].split()[-5:]]
    assert all(angle > 10.0 for angle in angles)


def test_the_end_that_is_printed_is_the_end_at_any_rate(capsys):
    arguments = ["walk", ROBOT, *SOFT, "--seed", "1", "--duration", "1.9 s"]
    (fine,), (coarse,) = (printed(*arguments, "--rate", rate, "--json")["walks"] for rate in ("100", "0.1 Hz"))
    np.testing.assert_allclose([coarse["x_m"], coarse["y_m"]], [fine["x_m"], fine["y_m"]], atol=1e-4)
    assert coarse["mean_joint_angles_rad"] == [None] * 5
    assert coarse["axis_radius_m"] is None
    for rate, there in (("100", "mean of the last 1.9 s"), ("0.1", "too few samples for means")):
        assert main([*arguments, "--rate", rate]) == 0
        assert there in capsys.readouterr().out


def test_a_walk_that_leaves_the_range_says_so(capsys):
    arguments = ["walk", ROBOT, "--set", "springs.stiffness[0]=2 N*mm/deg", "--initial-joints", "10,0,0,0,0 deg"]
    assert main(arguments) == 0
    assert "more than a right angle" in capsys.readouterr().out
    (walk,) = printed(*arguments, "--json")["walks"]
    assert (walk["status"], walk["x_m"]) == ("out of range", None)


@pytest.mark.parametrize(
    ("arguments", "start"),
    [
        (["walk", ROBOT, "--duration", "abc"], "--duration = 'abc': "),
        (["walk", ROBOT, "--duration", "1e6 s"], "--duration = '1e6 s': is out of range; allowed: more than 0, at m"),
        (["walk", ROBOT, "--initial-joints", "2 kg"], "--initial-joints = '2 kg': "),
        (["walk", ROBOT, "--initial-joints", "120 deg"], "--initial-joints = '120 deg': must be smaller"),
        (["walk", ROBOT, "--set", "1"], "--set = '1': must be an override"),
        (
            ["walk", ROBOT, "--set", "springs.stiffness[ 0]=1"],
            "--set springs.stiffness[ 0]: must be the path of a parameter",
        ),
        (["turn", ROBOT, "--target", "170 deg, 1 m"], "--target bearing = '170 deg': "),
        (["turn", ROBOT, "--target", "0 deg, 1 m", "--k1", "-3"], "--k1 = '-3': must be positive"),
        (["turn", ROBOT, "--target", "0 deg, 1 m", "--duration", "1e6 s"], "--duration = '1e6 s': is out of range"),
        (["branch", ROBOT, "--between", "1 kg", "2 kg"], "--between springs.stiffness[0] = '1 kg': is a mass"),
        (
            ["branch", ROBOT, "--parameter", "k1"],
            "--parameter = 'k1': must be the path of a parameter; allowed: body.l",
        ),
        (["branch", ROBOT, "--parameter", "springs.lag"], "--parameter = 'springs.lag': must be a number that the"),
        (["robot", "new", "x.toml", "--modules", "1"], "--modules = '1': "),
        (["robot", "export", "aoi2022", "--out", "x.pdf"], "--out = 'x.pdf': "),
        (["identify", "twin", ROBOT], "twin: the table [twin] must be given in the robot file"),
    ],
)
def test_options_are_named_as_they_are_typed(monkeypatch, tmp_path, arguments, start):
    monkeypatch.chdir(tmp_path)
    assert refused(*arguments).startswith(f"error: {start}")


def test_turn_finds_a_spring_that_arrives(tmp_path):
    folder = tmp_path / "there"
    found = printed("turn", ROBOT, "--target", "45 deg, 1.3 m", "--json", "--out", str(folder))
    assert found["circle_radius_m"] == pytest.approx(1.3 / np.sqrt(2.0))
    per_unit = np.deg2rad(1.0) * 1000.0  # N*m/rad to N*mm/deg
    assert found["spring_by_law_N_m_rad"] * per_unit == pytest.approx(11.782, abs=0.001)
    assert 9.0 < found["spring_N_m_rad"] * per_unit < 10.5
    (walk,) = found["walks"]
    assert walk["outcome"] == "arrived"
    assert walk["nearest_m"] < 0.01
    assert walk["arrival_s"] == found["evaluation_time_s"]
    assert {file.name for file in folder.iterdir()} == {"turn.png", "turn.svg", "turn.nc", "turn.html"}
    again = ["turn", ROBOT, "--target", "45 deg, 1.3 m", "--k1", "10 N*mm/deg", "--out", str(folder)]
    assert "--force" in refused(*again)
    assert main([*again, "--force"]) == 0


def test_turn_with_a_given_spring_and_the_other_strategies():
    target = ["--target", "-45 deg, 1.3 m", "--json"]
    outcomes = {
        (strategy, spring): printed("turn", ROBOT, *target, "--strategy", strategy, "--k1", spring)["walks"][0]
        for strategy, spring in (
            ("pitchfork", "7 N*mm/deg"), ("pitchfork", "9.8 N*mm/deg"), ("pitchfork", "21 N*mm/deg"),
            ("hopf", "5 N*mm/deg"), ("leg-yaw", "auto"), ("open-loop", "10 N*mm/deg"),
        )
    }  # fmt: skip
    assert [walk["outcome"] for walk in outcomes.values()] == [
        "turned inside", "arrived", "bulged outside", "bulged outside", "bulged outside", "bulged outside",
    ]  # fmt: skip
    assert outcomes["open-loop", "10 N*mm/deg"]["epsilon3_rad2_s"] == 0.0


def test_a_target_straight_ahead_has_no_circle():
    told = run("turn", ROBOT, "--target", "0 deg, 1 m", "--strategy", "leg-yaw", "--duration", "1 s")[1]
    assert "the circle to the target is a straight line" in told
    assert "inf" not in told


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["walk", ROBOT, "--duration", "0 s"], ["duration", "more than 0"]),
        (["walk", ROBOT, "--duration", "3 kg"], ["kg"]),
        (["walk", ROBOT, "--rate", "0"], ["rate"]),
        (["walk", ROBOT, "--rate", "7 s"], ["--rate = '7 s'", "Hz"]),
        (["walk", ROBOT, "--repeats", "0"], ["--repeats"]),
        (["walk", ROBOT, "--repeats", "3"], ["repeats", "seed"]),
        (["walk", ROBOT, "--trials", "/dev/null/trials"], ["/dev/null/trials", "cannot be written"]),
        (["walk", ROBOT, "--initial-joints", "1,2 deg"], ["not 2", "5"]),
        (["walk", ROBOT, "--set", "springs.stiffness=0 N*mm/deg"], ["springs.stiffness", "positive"]),
        (["walk", ROBOT, "--controller", "nosuch.module:Class"], ["cannot be imported", "nosuch"]),
        (["walk", ROBOT, "--controller", "Class"], ["must name an object", "package.module:Class"]),
        (["walk", ROBOT, "--controller", ""], ["must name an object"]),
        (["turn", ROBOT, "--target", "0 deg, 0 m"], ["distance"]),
        (["turn", ROBOT, "--target", "20 deg, 0.1 m"], ["distance", "0.15"]),
        (["turn", ROBOT, "--target", "45"], ["45 deg, 1.3 m"]),
        (["turn", ROBOT, "--target", "45 m, 1.3 m"], ["target"]),
        (["turn", ROBOT, "--target", "80 deg, 0.4 m"], ["must be at least the tightest radius"]),
        ([*THERE, "--strategy", "pitchfrok"], ["did you mean 'pitchfork'"]),
        ([*THERE, "--k1", "0 N*mm/deg"], ["must be positive"]),
        ([*THERE, "--k1", "atuo"], ["atuo"]),
        ([*THERE, "--strategy", "hopf", "--k1", "law"], ["radius law"]),
        ([*THERE, "--strategy", "leg-yaw", "--k1", "9 N*mm/deg"], ["--k1", "leg-yaw", "auto"]),
        ([*THERE, "--repeats", "2"], ["seed"]),
        ([*THERE, "--set", "legs.half_width=0.3 m"], ["no pitchfork"]),
    ],
)
def test_what_cannot_be_walked_is_refused(arguments, words):
    message = refused(*arguments)
    assert all(word in message for word in words), message


def test_the_rate_that_the_help_names_is_that_of_records(capsys):
    assert main(["walk", "--help"]) == 0
    words = capsys.readouterr().out.replace("│", " ").split()
    assert f"[default: {RATE:g} Hz]" in " ".join(words)


OWN = """
import time
from dataclasses import dataclass
import numpy as np
from chilopod.engine import Command, Event

@dataclass(frozen=True)
class Left:
    yaw: float = 0.08
    pause: float = 0.0

    def events(self, gait):
        return [Event("now", 0.0, 0.1)]

    def act(self, event, seen):
        time.sleep(self.pause)
        return Command(leg_yaw=np.full((len(seen.bearing), 2), self.yaw), within=event.window)

@dataclass(frozen=True)
class Right(Left):
    yaw: float = -0.08

@dataclass(frozen=True)
class Slow(Left):
    pause: float = 0.25

@dataclass(frozen=True)
class Raises(Left):
    def act(self, event, seen):
        raise RuntimeError("nobody at home")

@dataclass(frozen=True)
class Nonsense(Left):
    def act(self, event, seen):
        return 7

@dataclass(frozen=True)
class Endless(Left):
    def events(self, gait):
        return [Event("never", 2.0, 0.1)]

class Loose:
    events, act = Left.events, Left.act

import chilopod.planar as model

class Engine:
    def __getattr__(self, name):
        return getattr(model, name)

toy = Engine()
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """The name of a module in the current folder that nothing else has imported."""
    name = f"own_{tmp_path.name.replace('-', '_')}"
    (tmp_path / f"{name}.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    yield name
    sys.modules.pop(name, None)


def test_a_controller_of_ones_own_steers_a_walk(own):
    arguments = ["walk", ROBOT, *SOFT, "--duration", "20 s", "--json"]
    ends = {}
    for name in ("Left", "Right"):
        found = printed(*arguments, "--controller", f"{own}:{name}")
        assert found["controller"] == f"{own}:{name}"
        ends[name] = found["walks"][0]["y_m"]
    assert ends["Left"] > 0.05
    assert ends["Right"] == pytest.approx(-ends["Left"], rel=1e-2)  # mirrored, half a cycle later
    assert os.getcwd() not in sys.path


def test_a_controller_of_ones_own_turns_in_place_of_the_strategys(own, tmp_path):
    arguments = ["turn", ROBOT, "--target", "45 deg, 1.3 m", "--json", "--duration", "15 s"]
    left, right = (
        printed(*arguments, "--k1", "9 N*mm/deg", "--controller", f"{own}:{name}") for name in ("Left", "Right")
    )
    assert left["controller"] == f"{own}:Left"
    assert left["walks"][0]["nearest_m"] < right["walks"][0]["nearest_m"]
    # Also where the strategy has none, and in the search for the spring.
    found = printed(*arguments, "--strategy", "open-loop", "--controller", f"{own}:Left", "--trials", "kept")
    assert found["walks"][0]["nearest_m"] <= left["walks"][0]["nearest_m"]
    assert found["spring_N_m_rad"] != found["spring_by_law_N_m_rad"]
    assert len(list((tmp_path / "kept").iterdir())) > 48


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Raises", ["Raises.act", "RuntimeError", "nobody at home"]),
        ("Nonsense", ["Nonsense", "must be a chilopod.engine.Command"]),
        ("Endless", ["Endless.events", "must be a phase"]),
        ("Loose", ["frozen dataclass"]),
        ("Lefft", ["has no Lefft", "did you mean 'Left'"]),
        ("toy", ["must name a class"]),
    ],
)
def test_controllers_that_are_none_are_refused_in_one_line(own, name, words):
    others = [[*TURN, "--k1", "10 N*mm/deg"], ["course", "--targets", "0 deg, 1 m"]]
    for command in [["walk"], *(others if name == "Raises" else ())]:
        message = refused(command[0], ROBOT, *command[1:], "--controller", f"{own}:{name}")
        assert all(word in message for word in words), message


def test_a_controller_that_takes_most_of_the_time_is_named(capsys, own):
    assert main(["walk", ROBOT, "--duration", "2 s", "--controller", f"{own}:Slow", "--json"]) == 0
    captured = capsys.readouterr()
    assert "the controller took" in captured.err.splitlines()[-1]
    assert "slow" not in str(json.loads(captured.out)["walks"])
    assert main(["walk", ROBOT, "--duration", "2 s", "--controller", f"{own}:Left"]) == 0
    assert "the controller took" not in capsys.readouterr().err


def test_an_engine_of_ones_own_walks(own):
    arguments = ["walk", ROBOT, *SOFT, "--duration", "2 s", "--seed", "1", "--json"]
    found, planar = printed(*arguments, "--engine", f"{own}:toy"), printed(*arguments)
    assert found["engine"] == f"{own}:toy"
    assert found["walks"] == planar["walks"]
    assert "must be an object, not a class; allowed: an instance" in refused("walk", ROBOT, "--engine", f"{own}:Left")


def test_walks_are_kept_and_not_walked_again(tmp_path):
    folder = tmp_path / "kept"
    arguments = ["walk", ROBOT, *SOFT, "--duration", "3 s", "--seed", "1", "--json", "--trials", str(folder)]
    first = printed(*arguments, "--repeats", "2")
    kept = {file.name: file.stat().st_mtime_ns for file in folder.iterdir()}
    assert len(kept) == 2
    third = printed(*arguments, "--repeats", "3")
    assert third["walks"][:2] == first["walks"]
    assert {name: (folder / name).stat().st_mtime_ns for name in kept} == kept
    assert len(list(folder.iterdir())) == 3
    # Another's record in the place of one's own does not count.
    one, other = list(kept)
    (folder / one).write_bytes((folder / other).read_bytes())
    assert printed(*arguments, "--repeats", "2") == first
    assert (folder / f"{one}.aside").exists()


def test_a_walk_whose_angles_are_shown_as_zero_is_straight(capsys):
    assert main(["walk", ROBOT, "--set", "body.modules=2", "--seed", "1", "--duration", "20 s"]) == 0
    assert capsys.readouterr().out.splitlines()[2].split()[-2:] == ["straight", "+0.00"]


def test_a_walk_that_nothing_bends_says_why(capsys):
    why = "nothing disturbed it, so nothing bends it"
    arguments = ["walk", ROBOT, *SOFT, "--duration", "3 s"]
    assert main(arguments) == 0
    out = capsys.readouterr().out
    assert why in out
    assert "straight" in out.splitlines()[2]
    for more in (["--seed", "1"], ["--initial-joints", "2 deg"]):
        assert main([*arguments, *more]) == 0
        assert why not in capsys.readouterr().out
    arguments = ["turn", ROBOT, "--target", "45 deg, 1.3 m", "--k1", "9 N*mm/deg", "--duration", "3 s"]
    for strategy, straight in (("open-loop", True), ("pitchfork", False)):
        assert main([*arguments, "--strategy", strategy]) == 0
        assert (why in capsys.readouterr().out) is straight


def test_choices_are_listed_and_completed(capsys):
    engine = EngineOption.__metadata__[0]
    assert engine.metavar.split("|") == [*engine.autocompletion(), "MODULE:OBJECT"] == [*ENGINES, "MODULE:OBJECT"]
    assert main(["turn", "--help"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert f"--strategy {'|'.join(STRATEGIES)} " in out
    assert all("".join(each.sentence.split()) in out.replace(" ", "") for each in STRATEGIES.values())
    assert f"within {ARRIVAL_RADIUS:g} m of the target" in out
    assert f"by default {planar.traits.duration_ratio:g} (planar) or {twin.traits.duration_ratio:g} (twin) times" in out
