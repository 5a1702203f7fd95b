"""Everything that the code of a controller can reach is part of what a trial is, or the trial is not kept."""

import importlib
import os
import subprocess
import sys
import textwrap
import threading
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import edited_controllers as edits
from chilopod import load_robot
from chilopod.engine import Command, Event
from chilopod.steering import Target
from chilopod.trials import NONE, Disturbance, Trial, run
from chilopod.trials.reach import Reach, UnknownKindError

PLANAR = load_robot("aoi2022-planar")
REFUSED = {"hidden state", "ufunc of one's own", "imported by name", "evaluated", "state of a generator"}
BY_NAME = {"global by name", "attribute by name", "helper by name", "lookup of a module", "class of a module"}


@pytest.mark.parametrize("where", edits.PLACES)
def test_an_edit_anywhere_makes_another_trial_or_none_that_is_kept(where, tmp_path):
    outcome = edits.edited(where, "0.2", "0.3", tmp_path)
    assert outcome.kind is (edits.Kind.REFUSED if where in REFUSED else edits.Kind.ENDED)
    assert outcome.said == "" or outcome.kind is edits.Kind.REFUSED


@pytest.mark.parametrize("where", sorted(edits.PLACES.keys() - REFUSED - BY_NAME))
def test_it_is_seen_in_objects_too_whatever_files_say_by_now(where, tmp_path, monkeypatch):
    monkeypatch.setattr("chilopod.trials.reach.Reach._module", lambda *_: iter(()))
    assert edits.edited(where, "0.2", "0.3", tmp_path).said == ""


@dataclass(frozen=True)
class Attr:
    """Whose gain is its class's."""

    gain = 0.1

    def events(self, gait):
        return [Event("now", 0.0, 0.1)]

    def act(self, event, seen):
        return Command(leg_yaw=[[type(self).gain, 0.0]])


@pytest.mark.parametrize("anew", [True, False])
def test_a_class_that_is_changed_in_the_meantime_is_another(tmp_path, monkeypatch, anew):
    asked = [Trial(PLANAR, 0.7, controller=Attr())]
    (first,) = run(asked, tmp_path)
    monkeypatch.setattr(Attr, "gain", -0.05)
    (second,) = run([Trial(PLANAR, 0.7, controller=Attr())] if anew else asked, tmp_path)
    assert [float(record.command[0, 0, 0]) for record in (first, second)] == [0.1, -0.05]
    assert len(list(tmp_path.iterdir())) == 2


@dataclass(frozen=True)
class Locked(Attr):
    """Reaches what nobody can describe."""

    lock = threading.Lock()


def test_what_cannot_be_described_walks_and_is_not_kept(tmp_path, caplog):
    asked = [Trial(PLANAR, 0.7, seed, controller=Locked()) for seed in range(3)]
    assert len({each.file_name for each in asked}) == 3
    assert [record.attrs.get("not kept") for record in run(asked, tmp_path)] == [None] * 3
    assert not tmp_path.exists() or not list(tmp_path.iterdir())
    (said,) = [each.message for each in caplog.records if each.name == "chilopod.trials.store"]
    assert "Locked: its trials run but are not kept: Locked.lock: an object of type lock, which cannot be" in said


COUNT, STATE = [0], [0.0]


@dataclass(frozen=True)
class Counting(Attr):
    def act(self, event, seen):
        COUNT[0] += 1
        return Command(leg_yaw=[[0.01 * (COUNT[0] % 7), 0.0]])


@dataclass(frozen=True)
class Remembering(Attr):
    def act(self, event, seen):
        STATE[0] += 1.0
        return Command(leg_yaw=[[0.1, 0.0]])


@dataclass(frozen=True)
class Coupled(Attr):
    def act(self, event, seen):
        return Command(leg_yaw=np.full((len(seen.joint_angles), 2), 0.3 * seen.joint_angles.mean()))


@dataclass(frozen=True)
class Lonely(Attr):
    def act(self, event, seen):
        return Command(leg_yaw=np.zeros((2, 2))[: len(seen.joint_angles)])


@dataclass(frozen=True)
class Steady(Attr):
    def act(self, event, seen):
        return Command(leg_yaw=0.1 * np.stack([seen.bearing, seen.bearing], axis=1))


DOUBTS = {
    "it fails among other robots": Lonely(),
    "changes while it steers": Remembering(),
    "equal observations give different commands": Counting(),
    "commands depend on other robots of the batch": Coupled(),
}


@pytest.mark.parametrize("reason", DOUBTS)
def test_a_controller_that_does_not_repeat_itself_is_not_kept(reason, tmp_path, caplog):
    records = run([Trial(PLANAR, 0.7, seed, controller=DOUBTS[reason]) for seed in range(2)], tmp_path)
    assert [each.status.item() for each in records] == ["walked"] * 2
    assert list(tmp_path.iterdir()) == []
    (said,) = [each.message for each in caplog.records if each.name == "chilopod.trials.store"]
    assert reason in said


def test_a_controller_of_ones_own_is_kept_whatever_disturbs_its_walks(tmp_path):
    """The robots beside it are disturbed as it is: noise of their sensors would be its own too."""
    robot = load_robot("aoi2022")
    for engine, disturbance in (("planar", NONE), ("twin", NONE), ("twin", Disturbance())):
        run([Trial(robot, 0.3, 0, (), Target(0.4, 1.2), Steady(), disturbance, engine=engine)], tmp_path)
    assert len(list(tmp_path.glob("*.nc"))) == 3


LATE = [0.0]


@dataclass(frozen=True)
class Late(Attr):
    def act(self, event, seen):
        if seen.time > 1.0:  # after the first gait cycle
            LATE[0] += 1.0
        return Command(leg_yaw=[[0.01 * LATE[0], 0.0]])


def test_a_controller_whose_state_changes_after_the_first_cycle_is_not_kept(tmp_path, caplog):
    for seed in range(2):
        run([Trial(PLANAR, 2.0, seed, controller=Late())], tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert {"an object that its code can reach changes while it steers" in each.message for each in caplog.records} == {
        True
    }


CHANCE = """
import datetime, os, random, secrets, sys, tempfile, threading, time, uuid
import numpy as np
from scipy import sparse, stats
from dataclasses import dataclass
from datetime import datetime as day
from random import random as drawn
from time import perf_counter as clock
from chilopod.engine import Command, Event
KINDS = {"a", "bc", "def"}
now, TABLE = day.now, {"clock": time.monotonic}
def helper(): return time.time()
@dataclass(frozen=True)
class Own:
    id: int = 3
    time: float = 0.5
    def events(self, gait): return [Event("now", 0.0, 0.1)]
    def act(self, event, seen):
        yaw = 0.0
        if seen.time > 1.0:  # after the first cycle, which is walked twice
            BODY
            yaw = 0.1 * (float(yaw) % 1.0)
        return Command(leg_yaw=[[yaw, 0.0]])
"""
ORDER = "the order of a set"
VARIES = "equal observations give different commands (a clock, random numbers without a seed, a counter?)"
MAY_VARY = "which may vary from call to call or process to process; use seeds, and sort sets"
BY_CHANCE = {
    "yaw = stats.norm.rvs()": VARIES,
    "yaw = stats.uniform(0, 1).rvs()": VARIES,
    "yaw = sparse.random(1, 1, 1.0).toarray()[0, 0]": VARIES,
    "yaw = getattr(np, 'random').rand()": VARIES,
    "yaw = sum(map(ord, tempfile.mktemp())) / 1000": VARIES,
    "yaw = np.datetime64('now', 'us').astype(int) / 1000": "datetime64 now",
    "yaw = np.datetime64('today').astype(int) / 1000": "datetime64 today",
    "yaw = threading.get_ident() % 97 / 97": "threading.get_ident",
    "yaw = [len(each) for each in {'a', 'bc', 'def'}][0] / 10": ORDER,
    "yaw = len(next(iter({'a', 'bc'}))) / 10": ORDER,
    "yaw = len(list(KINDS)[0]) / 10": ORDER,
    "kinds = {'a', 'bc', 'def'}; yaw = len(kinds.pop()) / 10": ORDER,
    "yaw = (lambda: len(next(iter(KINDS))) / 10)()": ORDER,
    "yaw = np.random.uniform()": "numpy.random.uniform",
    "np.random.seed(1); yaw = np.random.rand()": "numpy.random.seed",
    "rng = np.random.default_rng(); yaw = rng.random()": VARIES,
    "yaw = np.random.default_rng(None).random()": VARIES,
    "make = np.random.default_rng; yaw = make().random()": VARIES,
    "yaw = random.random()": "random.random",
    "yaw = drawn()": "random.random",
    "yaw = random.Random().random()": VARIES,
    "yaw = random.SystemRandom().random()": "random.SystemRandom",
    "yaw = [random.gauss(0, 1) for _ in range(2)][0]": "random.gauss",
    "yaw = (lambda: random.gauss(0, 1))()": "random.gauss",
    "yaw = secrets.randbelow(9)": "secrets.randbelow",
    "yaw = uuid.uuid4().int": "uuid.uuid4",
    "yaw = time.time()": "time.time",
    "yaw = clock()": "time.perf_counter",
    "t = time; yaw = t.time()": "time.time",
    "yaw = getattr(time, 'time')()": "time",
    "import time as t; yaw = t.time()": "time.time",
    "from time import sleep, time; yaw = time()": "time.time",
    "import numpy.random; yaw = numpy.random.rand()": "numpy.random.rand",
    "import numpy.random as nr; yaw = nr.rand()": "numpy.random.rand",
    "yaw = TABLE['clock']()": "time.monotonic",
    "yaw = helper()": "time.time",
    "yaw = datetime.datetime.now().second": "datetime.now",
    "yaw = day.today().second": "datetime.today",
    "yaw = datetime.date.today().day": "date.today",
    "yaw = now().second": "datetime.now",
    "yaw = os.getpid()": "os.getpid",
    "yaw = os.urandom(1)[0]": "os.urandom",
    "yaw = hash('abc')": "builtins.hash",
    "yaw = id(self)": "builtins.id",
    "yaw = max(map(id, [self]))": "builtins.id",
}
DETERMINED = (
    "yaw = 0.1 * ('a' in KINDS) + 0.1 * ('b' not in {'a', 'bc', 'def'}) + 0.01 * len(KINDS)",
    "yaw = 0.1 * len(sorted(KINDS)[0])",
    "kinds = {'a', 'bc', 'def'}; yaw = 0.1 * ('a' in kinds)",
    "yaw = 0.1 * [each for each in {2, 3, 5}][0]",
    "yaw = stats.norm.rvs(random_state=3)",
    "seen.joint_angles[:] = 0.0; yaw = 0.1",
    "yaw = self.id + self.time + seen.time",
    "yaw = np.random.default_rng(7).random()",
    "yaw = np.random.default_rng(seed=self.id).random()",
    "rng = np.random.Generator(np.random.PCG64(self.id)); yaw = rng.random()",
    "yaw = random.Random(self.id).random()",
    "yaw = uuid.uuid5(uuid.NAMESPACE_DNS, 'a').int",
    "time.sleep(0.0); hash = self.id; yaw = hash",
    "yaw = datetime.datetime(2020, 1, 2).day + len(os.sep)",
    "yaw = {self: 0.1}[self]",
)


@pytest.mark.parametrize("body", [*BY_CHANCE, *DETERMINED])
def test_what_answers_otherwise_in_every_process_walks_and_is_not_kept(body, tmp_path, monkeypatch, caplog):
    (tmp_path / "own_chance.py").write_text(CHANCE.replace("BODY", body))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "own_chance", raising=False)
    asked = Trial(PLANAR, 1.5, rate=10.0, controller=importlib.import_module("own_chance").Own())
    (record,) = run([asked], tmp_path / "kept")
    sys.modules.pop("own_chance")
    assert record.status.item() == "walked"
    assert len(list((tmp_path / "kept").iterdir())) == (body in DETERMINED)
    (said,) = [each.message for each in caplog.records if each.name == "chilopod.trials.store"] or [""]
    why = BY_CHANCE.get(body, "")
    assert said.endswith(why if why in ("", VARIES) else f": {why}, {MAY_VARY}")
    assert (said == "") == (body in DETERMINED)


@dataclass(frozen=True)
class ByName(Attr):
    def act(self, event, seen):
        return Command(leg_yaw=[[sys.modules["ti" + "me"].gain, 0.0]])


def test_modules_that_are_looked_up_by_name_cannot_be_described():
    with pytest.raises(UnknownKindError, match="imports modules by name"):
        Reach().see(ByName, "ByName")


class Table(np.ndarray):
    """Pickle forgets what it adds to an array."""


def by_name(how):
    """A controller's class that reaches code by name, in its own way."""
    space = {}
    exec(f"import pkgutil, pydoc, runpy, sys\nfrom sys import modules\nfind = pkgutil.resolve_name\n{how}", space)
    return type("Found", (), {"act": space["act"]})


@pytest.mark.parametrize(
    "how",
    ["pkgutil.resolve_name('a:b')", "runpy.run_module('a')", "runpy.run_path('a')", "pydoc.locate('a.b')",
     "find('a:b')", "modules['a']", "list(map(find, 'ab'))"],
)  # fmt: skip
def test_the_standard_library_leads_to_code_by_name_too(how):
    for text in (f"def act(): return {how}", f"from functools import partial\nact = partial(lambda: {how})"):
        with pytest.raises(UnknownKindError, match="imports modules by name"):
            Reach().see(by_name(text), "Found")
    Reach().see(by_name("def act(frame): return frame.eval('a'), frame.locate"), "Found")


def test_what_a_subclass_adds_to_an_array_is_part_of_it():
    found = []
    for value in (0.01, 0.05):
        table = np.zeros(1).view(Table)
        table.gain = value
        reach = Reach()
        reach.see(table, "table")
        found.append(reach.digest)
    assert found[0] != found[1]


def test_a_fresh_process_describes_the_same_and_walks_import_nothing_that_is_not_part_of_it(tmp_path):
    places = [where for where in edits.PLACES if where not in REFUSED]
    script = f"""
        import sys
        from pathlib import Path
        from chilopod import load_robot
        from chilopod.steering import LegYawController, Target
        from chilopod.trials import Trial, run
        from chilopod.trials.trial import _ABOVE
        steered = dict(target=Target(0.7, 1.3), controller=LegYawController())
        run([Trial(load_robot("aoi2022"), 0.1, engine="twin"), Trial(load_robot("aoi2022-planar"), 0.1, **steered)])
        assert not {{name.split(".")[1] for name in sys.modules if name.startswith("chilopod.")}} & {{*_ABOVE}}
        sys.path.append({str(Path(edits.__file__).parent)!r})
        import edited_controllers as edits
        for where in {places}:
            print(edits._described(where, "0.2", Path({str(tmp_path)!r}))[0])
    """
    there = {**os.environ, "PYTHONHASHSEED": "7"}
    command = [sys.executable, "-c", textwrap.dedent(script)]
    done = subprocess.run(command, env=there, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [edits._described(where, "0.2", tmp_path)[0] for where in places]
