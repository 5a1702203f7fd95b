"""Whatever an engine of one's own does wrong ends in one line that names it, and nothing is kept."""

import json
import sys
from random import Random

import pytest

import broken_engines as broken
import in_process


class Chosen(Random):
    """Chance that has chosen."""

    def __init__(self, fault):
        super().__init__(fault)
        self.fault = fault

    def choice(self, among):
        return self.fault


@pytest.mark.parametrize("fault", broken.FAULTS)
def test_an_engine_that_gives_something_else_is_refused(fault, tmp_path):
    outcome = broken.BrokenEngines().attack(Chosen(fault), in_process.new_place(tmp_path))
    assert outcome.kind is (broken.Kind.ENDED if fault == broken.NONE else broken.Kind.REFUSED)


CONTROLLERS = """
import os, subprocess, sys
from dataclasses import dataclass
from chilopod.engine import Command, Event
class Fatal(BaseException): pass
@dataclass(frozen=True)
class Prints:
    def events(self, gait): return [Event("now", 0.0, 0.1)]
    def act(self, event, seen):
        print("from Python")
        os.write(1, b"from the system")
        subprocess.run(["echo", "from a process"])
        return Command()
@dataclass(frozen=True)
class Closes(Prints):
    def act(self, event, seen):
        sys.stdout = sys.stderr = None
        return Command()
@dataclass(frozen=True)
class Dies(Prints):
    def act(self, event, seen):
        raise Fatal("nobody at home")
@dataclass(frozen=True)
class Leaves(Prints):
    def events(self, gait):
        raise GeneratorExit
"""


@pytest.mark.parametrize(("name", "code"), [("Prints", 0), ("Closes", 0), ("Dies", 2), ("Leaves", 2)])
def test_a_controller_that_meddles_with_streams_or_raises_anything_spoils_no_result(name, code, tmp_path, monkeypatch):
    place = in_process.new_place(tmp_path)
    (place.here / "own_controllers.py").write_text(CONTROLLERS)
    monkeypatch.delitem(sys.modules, "own_controllers", raising=False)
    arguments = ("walk", "aoi2022-planar", "--duration", "0.7 s", "--json", "--controller", f"own_controllers:{name}")
    ending = in_process.called(arguments, place)
    assert ending.escaped == ""
    assert ending.code == code
    if code == 0:
        assert json.loads(ending.out)["walks"][0]["status"] == "walked"
        assert (name == "Prints") == ("from Python" in ending.err and "from the system" in ending.err)
    else:
        (line,) = ending.err.splitlines()
        assert f"{name}." in line
        assert "raised" in line
    sys.modules.pop("own_controllers", None)
