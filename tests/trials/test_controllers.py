"""Controllers of one's own as parts of trials: any frozen dataclass, told apart by class, text and fields."""

import dataclasses
import enum
import pickle
import sys
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.engine import Command, Event, Observation, engine_named
from chilopod.errors import AnalysisError, ParameterError
from chilopod.gait import Gait
from chilopod.steering import LegYawController, Target
from chilopod.trials import Disturbance, Trial, run, together

PLANAR, WHOLE = load_robot("aoi2022-planar"), load_robot("aoi2022")
TARGET = Target(0.7, 1.3)


class Side(enum.Enum):
    LEFT, RIGHT = 1, 2


@dataclass(frozen=True)
class Weights:
    matrix: Any = 0.0
    bias: float = 0.0


@dataclass(frozen=True)
class Proportional:
    """The one of docs/walking.md."""

    gain: Any = 0.5
    most: float = 0.17

    def events(self, gait: Gait):
        return [Event("once a cycle", phase=0.0, window=0.1)]

    def act(self, event: Event, seen: Observation):
        yaw = np.clip(self.gain * np.nan_to_num(seen.bearing), -self.most, self.most)
        return Command(leg_yaw=np.stack([yaw, yaw], axis=1), within=event.window)


@dataclass(frozen=True)
class Opposite(Proportional):
    """Another class with equal fields."""

    def act(self, event: Event, seen: Observation):
        yaw = -np.clip(self.gain * np.nan_to_num(seen.bearing), -self.most, self.most)
        return Command(leg_yaw=np.stack([yaw, yaw], axis=1), within=event.window)


@dataclass(frozen=True)
class Anything(Proportional):
    """Whose field may be anything."""

    cache: dict = field(default_factory=dict, compare=False)

    def act(self, event: Event, seen: Observation):
        return Command()


@dataclass(frozen=True)
class Softening:
    """A spring that moves all the time, asked every 2 ms."""

    every: float = 0.002

    def events(self, gait: Gait):
        count = round(gait.period / self.every)
        return [Event("tick", k / count, self.every) for k in range(count)]

    def act(self, event: Event, seen: Observation):
        stiffness = seen.stiffness.copy()
        stiffness[:, 0] = 1.0 + 0.3 * np.sin(2.0 * seen.time)
        return Command(stiffness=stiffness, within=event.window)


def trial(controller, robot=PLANAR, **more):
    return Trial(robot, 1.0, 3, target=TARGET, controller=controller, rate=50.0, **more)


def test_the_documented_controller_steers_a_trial():
    (record,) = run([Trial(PLANAR, 20.0, 1, target=TARGET, controller=Proportional())])
    assert record.heading.isel(time=-1).item() > 0.1
    assert record.sizes["event"] == 34
    assert float(record.command.max()) == 0.17


def test_two_classes_with_equal_fields_do_not_share_a_file(tmp_path):
    one, other = trial(Proportional()), trial(Opposite())
    assert one.file_name != other.file_name
    records = run([one, other], tmp_path)
    assert not records[0].command.equals(records[1].command)
    assert len(list(tmp_path.iterdir())) == 2


def test_the_fields_of_a_controller_are_told_apart_whatever_they_are():
    values = [
        0.5, 1, 1.0, True, None, "a", (1, 2), (1, (2, 3)), np.array([1.0, 2.0]), np.array([1, 2]), Side.LEFT,
        Side.RIGHT, Weights(), Weights(1.0), Weights(np.eye(2)), Weights(Weights()), np.float32(0.5), np.float64(0.5),
        np.int8(100), 100, np.zeros((0, 3)), np.zeros(0), -0.0, 0.0, float("nan"), float("inf"), (), ((),),
    ]  # fmt: skip
    names = [trial(Anything(value)).file_name for value in values]
    assert len(set(names)) == len(names)
    assert names == [trial(Anything(value)).file_name for value in values]
    # What does not count when controllers are compared does not count here.
    assert trial(Anything(0.5, cache={"seen": object()})).file_name == names[0]


@pytest.mark.parametrize(
    ("value", "name"),
    [
        (object(), "Anything.gain"),
        ({1, 2}, "Anything.gain"),
        (len, "Anything.gain"),
        (Weights, "Anything.gain"),
        ((1.0, lambda: 0), "Anything.gain[1]"),
        (Weights(bias=b"x"), "Anything.gain.bias"),
        ({"a": 1.0}, "Anything.gain"),
        ([1.0], "Anything.gain"),
        (10**400, "Anything.gain"),
        (np.longdouble(1.0), "Anything.gain"),
        (np.array(["a"]), "Anything.gain"),
        (np.array([object()]), "Anything.gain"),
    ],
)
def test_what_is_no_plain_data_is_refused_by_name(value, name):
    with pytest.raises(ParameterError) as raised:
        trial(Anything(value))
    assert str(raised.value).startswith(f"{name} = ")
    assert "plain data" in str(raised.value)


def test_what_can_change_is_no_controller_of_a_trial():
    class Plain:
        events, act = Proportional.events, Proportional.act

    with pytest.raises(ParameterError, match="frozen"):
        trial(Plain())
    with pytest.raises(ParameterError, match="must have a method events"):
        trial(Weights())


def test_a_class_that_only_this_process_knows_is_not_kept(tmp_path, caplog):
    @dataclass(frozen=True)
    class Here(Proportional):
        pass

    assert together(run([trial(Here())])).sizes["robot"] == 1
    assert len(run([trial(Here())], tmp_path)) == 1
    assert list(tmp_path.iterdir()) == []
    (said,) = [each.message for each in caplog.records if each.name == "chilopod.trials.store"]
    assert said.endswith("it must be defined at the top of a module that can be imported")


def made_with(yaw):
    @dataclass(frozen=True)
    class Made(Proportional):
        def act(self, event: Event, seen: Observation):
            return Command(leg_yaw=[[yaw, yaw]])

    return Made()


def test_classes_that_a_function_makes_are_told_apart(tmp_path, caplog):
    asked = [trial(made_with(0.1)), trial(made_with(0.2))]
    assert [record.command.max().item() for record in run(asked)] == [0.1, 0.2]
    run([trial(Anything(made_with(0.1)))], tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert "must be defined at the top" in caplog.text


def test_an_edited_class_is_another(tmp_path, monkeypatch):
    text = """
from dataclasses import dataclass
from chilopod.engine import Command, Event

@dataclass(frozen=True)
class Own:
    def events(self, gait):
        return [Event("now", 0.0, 0.1)]

    def act(self, event, seen):
        return Command(leg_yaw=[[0.1, 0.1]])
"""
    monkeypatch.syspath_prepend(tmp_path)
    names, sent = [], []
    for yaw in ("0.1", "0.10", "0.15"):
        (tmp_path / "own_controller.py").write_text(text.replace("0.1,", f"{yaw},"))
        sys.modules.pop("own_controller", None)
        sys.path_importer_cache.clear()
        from own_controller import Own

        names.append(trial(Own()).file_name)
        sent.append(pickle.loads(pickle.dumps(trial(Own()))).file_name)
    # The second says the same in other words.
    assert names[0] == names[1] != names[2]
    assert sent == names


def test_what_counts_is_the_code_that_walks_not_what_its_file_says_by_now(tmp_path, monkeypatch):
    text = """
from dataclasses import dataclass
from chilopod.engine import Command, Event

if YAW > 0.1:
    @dataclass(frozen=True)
    class Stale:
        def events(self, gait): return [Event("now", 0.0, 0.1)]
        def act(self, event, seen): return Command(leg_yaw=[[YAW, YAW]])
else:
    @dataclass(frozen=True)
    class Stale:
        def events(self, gait): return [Event("now", 0.0, 0.1)]
        def act(self, event, seen): return Command(leg_yaw=[[0.05, YAW]])
"""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # it would not see a change within a second
    names = []
    for yaw in ("0.1", "0.2"):
        (tmp_path / "stale_controller.py").write_text(text.replace("YAW", yaw))
        sys.modules.pop("stale_controller", None)
        sys.path_importer_cache.clear()
        from stale_controller import Stale

        (tmp_path / "stale_controller.py").write_text("nothing = 0")  # before anybody asks
        names.append(trial(Stale()).file_name)
    assert names[0] != names[1]


def test_classes_without_a_text_or_a_module_are_told_apart_and_not_kept(tmp_path, caplog):
    def made(yaw):
        return dataclasses.make_dataclass(
            "Made",
            [],
            namespace={"events": Proportional.events, "act": lambda self, event, seen: Command(leg_yaw=[[yaw, yaw]])},
            frozen=True,
        )()

    one, other = trial(made(0.1)), trial(made(-0.1))
    assert [float(record.command[0, 0, 0]) for record in run([one, other])] == [0.1, -0.1]
    run([one], tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert "must be defined at the top" in caplog.text


def test_an_enum_with_another_value_is_another():
    def with_value(value):
        kind = enum.Enum("Side", {"LEFT": value}, module=__name__, qualname="Side")
        return trial(Anything(kind.LEFT)).text

    assert with_value(1) != with_value(2)


@dataclass(frozen=True)
class Remembering(Proportional):
    """Keeps count in an array of its own, as nobody should."""

    kept: Any = None

    def act(self, event: Event, seen: Observation):
        self.kept[0] += 0.01
        return Command(leg_yaw=[[self.kept[0], 0.0]])


def test_a_controller_that_changes_itself_is_found_out(tmp_path):
    with pytest.raises(AnalysisError, match="Remembering: must not change its own fields"):
        run([trial(Remembering(kept=np.zeros(1)))], tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"seed": None}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"seed": -1}, "seed"),
        ({"duration": "1"}, "duration"),
        ({"duration": None}, "duration"),
        ({"duration": 0.0}, "duration"),
        ({"rate": "often"}, "rate"),
        ({"joint_angles": (0.1, 0.2)}, "joint_angles"),
        ({"joint_angles": (0.1, 0.2, 0.3, 0.4, float("nan"))}, "joint_angles"),
        ({"target": (1.0, 1.0)}, "target"),
        ({"forces": "yes"}, "forces"),
        ({"engine": None}, "engine"),
        ({"engine": "plannar"}, "engine"),
        ({"robot": None}, "robot"),
        ({"disturbance": 0.0}, "disturbance"),
    ],
)
def test_a_trial_that_is_none_is_named(arguments, field):
    with pytest.raises(ParameterError) as raised:
        Trial(**{"robot": PLANAR, "duration": 1.0, **arguments})
    assert raised.value.field == field
    assert "\n" not in str(raised.value)


def test_equal_trials_have_one_file_whatever_kinds_of_numbers_they_were_given():
    one = Trial(PLANAR, 1.0, 3, (0.1, 0.0, 0.0, 0.0, 0.0), Target(0.5, 1.0), rate=20.0, forces=True)
    other = Trial(
        PLANAR, 1, np.int64(3), np.array([0.1, 0, 0, 0, 0]), Target(0.5, 1), rate=np.float32(20), forces=np.True_
    )
    assert one == other
    assert one.file_name == other.file_name


def test_our_own_controllers_have_the_sources_of_chilopod_instead_of_a_text():
    assert trial(LegYawController()).code == ("", "", "")
    assert '"class": "chilopod.steering.leg_yaw:LegYawController"' in trial(LegYawController()).text


@pytest.mark.parametrize("engine", ["planar", "twin"])
def test_events_within_a_step_of_the_twin_see_one_state(engine):
    robot = PLANAR if engine == "planar" else WHOLE
    walk = engine_named(engine).start([robot], initial=engine_named(engine).initial_states(robot, [[0.2] * 5]))
    seen = []
    for time in np.arange(1, 12) * 0.001:
        walk.advance(time)
        seen.append(walk.observe().joint_angles[0])
    same = (np.diff(seen, axis=0) == 0.0).all(axis=1)
    assert same.tolist() == ([False] * 10 if engine == "planar" else [True, False] * 5)


@pytest.mark.parametrize("engine", ["planar", "twin"])
def test_a_spring_can_be_moved_every_2_ms(engine, tmp_path):
    robot = (PLANAR if engine == "planar" else WHOLE).set_from_text(["springs.adjustable[0]=true"])
    asked = [
        Trial(robot, 1.2, seed, controller=Softening(), rate=100.0, engine=engine, disturbance=Disturbance())
        for seed in range(2)
    ]
    records = run(asked, tmp_path)
    cycles = 1.2 / robot.gait.period
    for record in records:
        assert record.status.item() == "walked"
        assert record.sizes["event"] == pytest.approx(cycles * round(robot.gait.period / 0.002), abs=2)
        moved = record.stiffness.isel(robot=0).sel(joint=1)
        times = record.time.values[5:]
        # Every ramp ends 2 ms after what asked for it was meant.
        np.testing.assert_allclose(moved.values[5:], 1.0 + 0.3 * np.sin(2.0 * times), atol=2.5e-3)
    again = run(asked, tmp_path)
    assert all(one.equals(other) for one, other in zip(records, again, strict=True))
