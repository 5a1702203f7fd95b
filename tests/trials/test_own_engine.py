"""The engine of docs/engines.md in trials and on the command line, and engines that are none."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.cli import main
from chilopod.engine import engine_named
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
