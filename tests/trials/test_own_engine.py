"""The engine of docs/engines.md in trials and on the command line, and engines that are none."""

import json
import os
import re
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from chilopod import load_robot, planar
from chilopod.cli import main
from chilopod.engine import Command, Event, engine_named
from chilopod.errors import AnalysisError, ParameterError
from chilopod.steering import LegYawController, Target
from chilopod.trials import Trial, run

ROBOT = load_robot("aoi2022-planar")
DOCS = Path(__file__).parents[2] / "docs" / "engines.md"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder one is in, with a module that has the engine of the docs, and others that are none."""
    (code,) = [
        each for each in re.findall(r"```python\n(.*?)```", DOCS.read_text(), flags=re.S) if "class Sketch" in each
    ]
    (tmp_path / "own_engines.py").write_text(
        code
        + """
import sys
class Lazy(Sketch):
    def start(self, robots, **given): return None
class OldWalk(SketchWalk):
    aim = halt = property()
class Old(Sketch):
    def start(self, robots, **given):
        walk = Sketch.start(self, robots, **given)
        walk.__class__ = OldWalk
        return walk
class Shared(Sketch):
    def common(self, robot): return [robot]
class Raising(Sketch):
    def initial_states(self, *given, **named): raise ZeroDivisionError("no\\nfloor")
class Silent(Sketch):
    traits = None
lazy, old, shared, raising, silent, three = Lazy(), Old(), Shared(), Raising(), Silent(), 3
class Unprintable(Exception):
    def __str__(self): raise RuntimeError
from dataclasses import dataclass
from chilopod.engine import Event
from chilopod import units
@dataclass(frozen=True)
class Steers:
    how: str = "exit"
    def events(self, gait): return [Event("now", 0.0, 0.1)]
    def act(self, event, seen):
        if self.how == "exit": sys.exit(3)
        if self.how == "ours": units.parse("3 parsecs", "m")
        raise Unprintable
@dataclass(frozen=True)
class Ours(Steers):
    how: str = "ours"
@dataclass(frozen=True)
class Worse(Steers):
    how: str = "unprintable"
"""
    )
    (tmp_path / "leaves.py").write_text("import sys\nsys.exit(3)\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in ("own_engines", "leaves"):
        sys.modules.pop(name, None)


def test_it_walks_in_trials_that_are_kept_alone_and_together(folder):
    asked = [
        Trial(ROBOT, 3.0, seed, target=Target(0.7, 1.3), controller=LegYawController(), engine="own_engines:sketch")
        for seed in range(5)
    ]
    records = run(asked, folder / "trials")
    assert len(list((folder / "trials").iterdir())) == 5
    assert all(record.attrs["engine"] == "sketch" for record in records)
    for one, other in zip(run(asked, folder / "trials"), records, strict=True):
        np.testing.assert_array_equal(one.position, other.position)
    np.testing.assert_array_equal(run(asked[3:4])[0].position, records[3].position)


def test_it_walks_and_turns_from_the_command_line(folder):
    """In a process of its own, where only the folder one is in leads to it."""
    there = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    source = str(Path(sys.modules["chilopod"].__file__).parents[1])

    def told(*arguments):
        command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {source!r}); sys.path.remove('')\n"
                   "from chilopod.cli import main; sys.exit(main(sys.argv[1:]))", *arguments]  # fmt: skip
        done = subprocess.run(command, cwd=folder, env=there, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    engine = ("--engine", "own_engines:sketch", "--seed", "1", "--trials", "kept", "--json")
    found = told("walk", "aoi2022-planar", "--duration", "2 s", "--repeats", "3", *engine)
    assert [each["status"] for each in found["walks"]] == ["walked"] * 3
    found = told("turn", "aoi2022-planar", "--target", "20 deg, 1 m", "--k1", "20 N*mm/deg", *engine)
    assert found["engine"] == "own_engines:sketch"
    assert len(list((folder / "kept").iterdir())) == 4


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("own_engines:Sketch", "must be an object, not a class"),
        ("own_engines:silent", "its traits must be a chilopod.engine.Traits"),
        ("own_engines:three", "attribute traits is missing"),
        ("own_engines:three.x", "has no three.x"),
        ("own_engines:thre", "did you mean 'three'"),
        ("leaves:engine", "cannot be imported: SystemExit: 3"),
        ("nowhere:engine", "cannot be imported: ModuleNotFoundError"),
        ("own_engines", "must be one of the engines"),
    ],
)
def test_an_engine_that_is_none_is_named(folder, name, words):
    with pytest.raises(ParameterError, match="engine = ") as raised:
        engine_named(name)
    assert words in str(raised.value)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("lazy", "start must return a"),
        ("old", "missing: aim, halt"),
        ("shared", "a hashable value"),
        ("raising", "ZeroDivisionError: no floor"),
    ],
)
def test_what_goes_wrong_in_an_engine_is_its_own_fault(folder, name, words):
    with pytest.raises(AnalysisError, match=f"engine own_engines:{name}.*{words}"):
        run([Trial(ROBOT, 1.0, engine=f"own_engines:{name}")])


@pytest.mark.parametrize(
    "arguments",
    [
        ("--engine", "leaves:x"), ("--engine", "own_engines:Sketch"), ("--engine", "own_engines:raising"),
        ("--engine", "own_engines:shared"), ("--controller", "leaves:X"), ("--controller", "own_engines:sketch.x"),
        ("--controller", "own_engines:Steers"), ("--controller", "own_engines:Ours"),
        ("--controller", "own_engines:Worse"),
    ],
)  # fmt: skip
def test_on_the_command_line_each_is_one_line(folder, capsys, arguments):
    assert main(["walk", "aoi2022-planar", "--duration", "0.5 s", *arguments]) == 2
    told = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(told) == 1
    if arguments[1] in ("own_engines:Steers", "own_engines:Ours", "own_engines:Worse"):
        assert f"{arguments[1].partition(':')[2]}.act: raised" in told[0]


GRIP = """
from chilopod import planar
GRIP = 1.0
class Grip:
    traits, common, initial_states, resume = planar.traits, planar.common, planar.initial_states, planar.resume
    common, initial_states, resume = map(staticmethod, (common, initial_states, resume))
    def start(self, robots, friction=None, **named):
        from own_grip_helper import MORE
        return planar.start(robots, friction=GRIP * MORE * friction, **named)
grip = Grip()
"""


@dataclass(frozen=True)
class Left:
    def events(self, gait):
        return [Event("now", 0.0, 0.1)]

    def act(self, event, seen):
        return Command(leg_yaw=[[0.1, 0.1]])


def filling(cache):
    def start(self, robots, **named):
        cache.append(robots)
        return planar.start(robots, **named)

    return start


@pytest.fixture
def named(tmp_path, monkeypatch):
    """Name of a trial with an engine in files as given, imported anew or as it was."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # it would not see a change within a second
    modules = ("own_grip", "own_grip_helper")

    def name(grip="GRIP = 1.0", helper="MORE = 1.0", anew=True):
        (tmp_path / "own_grip.py").write_text(GRIP.replace("GRIP = 1.0", grip))
        (tmp_path / "own_grip_helper.py").write_text(helper)
        for each in modules if anew else ():
            sys.modules.pop(each, None)
        sys.path_importer_cache.clear()
        return Trial(ROBOT, 1.0, engine="own_grip:grip").file_name

    yield name
    for each in modules:
        sys.modules.pop(each, None)


def test_what_an_engine_imports_within_a_function_is_part_of_a_trial(named):
    first = named()
    assert named(helper="MORE = 2.0") != first == named()


def test_an_engine_whose_file_was_edited_while_it_is_loaded_is_not_the_edited_one(named):
    names = named(), named("GRIP = 0.1", anew=False), named("GRIP = 0.1")
    assert len({*names}) == 3


def test_an_engine_is_its_numbers_as_they_are_now_and_a_module_may_be_one(named, monkeypatch):
    first = named()
    monkeypatch.setattr(sys.modules["own_grip"], "GRIP", 0.1)
    assert Trial(ROBOT, 1.0, engine="own_grip:grip").file_name != first
    for name in ("traits", "common", "initial_states", "start", "resume"):
        monkeypatch.setattr(sys.modules["own_grip_helper"], name, getattr(sys.modules["own_grip"].grip, name), False)
    monkeypatch.setattr(sys.modules["own_grip"], "other", sys.modules["own_grip_helper"], False)
    first = Trial(ROBOT, 1.0, engine="own_grip:other").file_name
    monkeypatch.setattr(sys.modules["own_grip"], "GRIP", 0.2)
    assert Trial(ROBOT, 1.0, engine="own_grip:other").file_name != first


def test_a_cache_of_an_engine_that_fills_is_no_change_of_a_controller(named, tmp_path, monkeypatch):
    named("CACHE = []", "MORE = 1.0")
    grip = sys.modules["own_grip"]
    monkeypatch.setattr(grip, "GRIP", 1.0, False)
    monkeypatch.setattr(type(grip.grip), "start", filling(grip.CACHE))
    run([Trial(ROBOT, 0.1, controller=Left(), engine="own_grip:grip")], tmp_path / "kept")
    assert len(list((tmp_path / "kept").iterdir())) == 1


def test_an_engine_with_an_object_that_cannot_be_described_walks_and_is_not_kept(named, tmp_path, caplog, monkeypatch):
    named()
    monkeypatch.setattr(sys.modules["own_grip"].grip, "lock", threading.Lock(), False)
    (record,) = run([Trial(ROBOT, 0.1, engine="own_grip:grip")], tmp_path / "kept")
    assert record.status.item() == "walked"
    assert not list((tmp_path / "kept").iterdir())
    assert "engine own_grip:grip: its trials run but are not kept: grip['lock']: an object of type lock" in caplog.text
