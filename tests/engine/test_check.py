"""The promises of the contract: kept by both engines and by the one in the docs, and missed where they are broken."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chilopod import load_robot, planar, twin
from chilopod.engine import Command, Status, Traits, check, check_engine
from chilopod.errors import AnalysisError, ParameterError

ROBOT = load_robot("aoi2022-planar")
DOCS = Path(__file__).parents[2] / "docs" / "engines.md"


@pytest.fixture(scope="module")
def docs():
    """Names that the code in the docs page defines."""
    code = "\n".join(re.findall(r"```python\n(.*?)```", DOCS.read_text(), flags=re.S))
    names = {"__name__": "docs"}
    exec(compile(code, str(DOCS), "exec"), names)
    return names


def test_the_planar_model_keeps_every_promise():
    assert len(check_engine(planar, ROBOT, seed=1)) == 17


@pytest.mark.parametrize("changes", [["body.modules=3"], ["gait.side_phase=0 deg"], ["springs.damping=0.05"]])
def test_the_planar_model_keeps_them_with_other_robots(changes):
    check_engine(planar, ROBOT.set_from_text(changes))


def test_the_twin_keeps_every_promise():
    robot = load_robot("aoi2022").set_from_text(["twin.control_interval=4 ms", "springs.stiffness[0]=10 N*mm/deg"])
    assert len(check_engine(twin, robot)) == 17


def test_the_engine_in_the_docs_keeps_every_promise(docs):
    assert len(check_engine(docs["Sketch"](), ROBOT)) == 17


def _wrapped(walk_class, **changes):
    return type("Broken", (walk_class,), changes)


def _forgets_to_record_units(original):
    def to_dataset(self):
        data = original.to_dataset(self)
        data.heading.attrs = {}
        return data

    return {"to_dataset": to_dataset}


def _draws_at_random(original):
    def advance(self, until):
        original.advance(self, until)
        self.here = self.here + 1e-12 * np.random.default_rng().normal(size=self.here.shape)

    return {"advance": advance}


def _counts_advances(original):
    def advance(self, until):
        original.advance(self, until)
        self.here = self.here * (1.0 + 1e-15)

    return {"advance": advance}


def _is_changed_by_looking(original):
    def observe(self):
        self.here = self.here + 1e-14
        return original.observe(self)

    return {"observe": observe}


def _looks_at_its_neighbours(original):
    def write(self):
        self.here = self.here + 1e-12 * (self.here - self.here.mean(axis=0))
        original.write(self)

    return {"write": write}


def _forgets_ramps(original):
    def save(self):
        told, self.told = self.told, type(self.told)(self.robots)
        try:
            return original.save(self)
        finally:
            self.told = told

    return {"save": save}


def _sees_in_degrees(original):
    def observe(self):
        seen = original.observe(self)
        return replace(seen, bearing=np.degrees(seen.bearing))

    return {"observe": observe}


def _gives_its_own_arrays(original):
    def observe(self):
        return replace(original.observe(self), leg_yaw=self.told.leg_yaw)

    return {"observe": observe}


def _obeys_before_it_refuses(original):
    def command(self, command):
        if isinstance(command, Command) and command.leg_yaw is not None:
            self.here = self.here + 1e-9
        original.command(self, command)

    return {"command": command}


def _ignores_its_limits(original):
    def __init__(self, robots, *rest):
        original.__init__(self, [robot.override("springs.softest", 1e-6) for robot in robots], *rest)
        self.robots = tuple(robots)

    return {"__init__": __init__}


def _ignores_torques(original):
    def command(self, command):
        original.command(self, command)
        self.told.joint_torque = 0.0 * self.told.joint_torque

    return {"command": command}


def _turns_the_other_way(original):
    def command(self, command):
        original.command(self, command)
        self.told.joint_torque = -self.told.joint_torque

    return {"command": command}


def _keeps_torques(original):
    def command(self, command):
        torque = self.told.joint_torque
        original.command(self, command)
        self.told.joint_torque = np.where(self.told.joint_torque == 0.0, torque, self.told.joint_torque)

    return {"command": command}


def _straightens_legs(original):
    def command(self, command):
        original.command(self, command if command.leg_yaw is not None else replace(command, leg_yaw=[[0.0, 0.0]]))

    return {"command": command}


def _never_fails(original):
    return {"status": property(lambda self: (Status.WALKED,) * len(self.robots))}


def _stops_everybody(original):
    def advance(self, until):
        original.advance(self, until)
        if not self.walking.all():
            self.ended[self.walking] = Status.OUT_OF_RANGE.name

    return {"advance": advance}


def _records_robots_that_failed(original):
    def write(self):
        ended, self.ended = self.ended, np.full_like(self.ended, Status.WALKED.name)
        original.write(self)
        self.ended = ended

    return {"write": write}


def _has_no_halt(original):
    return {"halt": property()}


def _is_changed_by_a_look_at_its_pose(original):
    def pose(self):
        self.here = self.here + 1e-14
        return original.pose(self)

    return {"pose": pose}


def _goes_where_it_is_aimed(original):
    def aim(self, target):
        original.aim(self, target)
        self.here = self.here + 1e-12

    return {"aim": aim}


def _aims_all_alike(original):
    def aim(self, target):
        original.aim(self, np.asarray(target, dtype=float).reshape(-1, 2)[0])

    return {"aim": aim}


def _halts_everybody(original):
    return {"halt": lambda self, which: original.halt(self, np.ones_like(which))}


def _counts_its_states_from_elsewhere(original):
    return {"states": lambda self: original.states(self) + 0.01}


def _restarts_everybody(original):
    return {"restart": lambda self, which, *rest: original.restart(self, which | which.any(), *rest)}


def _restarts_as_it_was_told(original):
    def restart(self, *arguments, **named):
        told = self.told.state()
        original.restart(self, *arguments, **named)
        self.told.restore(told)

    return {"restart": restart}


def _halts_for_a_moment(original):
    def advance(self, until):
        original.advance(self, until)
        self.ended[self.ended == Status.HALTED.name] = Status.WALKED.name

    return {"advance": advance}


@pytest.mark.parametrize(
    ("broken", "promise"),
    [
        (_forgets_to_record_units, "records under the names"),
        (_draws_at_random, "repeats a walk to the bit"),
        (_counts_advances, "for any advances and observations"),
        (_is_changed_by_looking, "for any advances and observations"),
        (_looks_at_its_neighbours, "alone and in a batch"),
        (_forgets_ramps, "when saved and resumed"),
        (_sees_in_degrees, "observes in the units"),
        (_gives_its_own_arrays, "observes in the units"),
        (_obeys_before_it_refuses, "refuses invalid commands"),
        (_ignores_its_limits, "keeps springs within"),
        (_ignores_torques, "turns joints"),
        (_turns_the_other_way, "turns joints.*bends joint 1 by -"),
        (_keeps_torques, "turns joints.*after a torque was set back to 0"),
        (_straightens_legs, "turns joints.*leg_yaw after the last command"),
        (_has_no_halt, "observes in the units.*missing: halt"),
        (_is_changed_by_a_look_at_its_pose, "returns poses without a change"),
        (_goes_where_it_is_aimed, "moves targets without a change"),
        (_aims_all_alike, "moves targets without a change"),
        (_halts_everybody, "halts robots finally"),
        (_halts_for_a_moment, "halts robots finally"),
        (_counts_its_states_from_elsewhere, "returns states from which"),
        (_restarts_everybody, "restarts robots without effect"),
        (_restarts_as_it_was_told, "restarts robots without effect"),
        (_never_fails, "stops a failed robot"),
        (_stops_everybody, "stops a failed robot"),
        (_records_robots_that_failed, "stops a failed robot"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_a_broken_promise_is_named(docs, monkeypatch, broken, promise):
    original, asked = docs["SketchWalk"], promise.partition(".*")[0]
    monkeypatch.setitem(docs, "SketchWalk", _wrapped(original, **broken(original)))
    # The others take a walk or more each.
    monkeypatch.setattr(check, "_PROMISES", {key: each for key, each in check._PROMISES.items() if asked in key})
    with pytest.raises(AnalysisError, match=promise):
        check_engine(docs["Sketch"](), ROBOT)


@pytest.mark.parametrize(("count", "mass"), [(3, "8.5 kg"), (6, "60 kg")])
def test_slow_joints_and_an_undulating_walk_break_no_promise(monkeypatch, count, mass):
    monkeypatch.setattr(check, "_PROMISES", {"turns": check._PROMISES["turns joints and legs as commanded"]})
    check_engine(twin, load_robot("aoi2022").set_from_text([f"body.modules={count}", f"body.mass={mass}"]))


def test_traits_and_noise_are_held_to(docs):
    engine = docs["Sketch"]()
    engine.traits = Traits(name="", sentence="nothing")
    with pytest.raises(AnalysisError, match="has valid traits"):
        check_engine(engine, ROBOT)
    engine.traits = Traits(name="sketch", sentence="noisy, it says", noisy=True)
    with pytest.raises(AnalysisError, match="draws noise only from its seeds"):
        check_engine(engine, ROBOT)


def test_a_walk_is_resumed_by_the_engine_and_version_that_saved_it(docs):
    saved = docs["Sketch"]().start(ROBOT).save()
    with pytest.raises(ParameterError, match="saved with another engine"):
        planar.resume(saved)
    with pytest.raises(ParameterError, match="another engine"):
        twin.resume(planar.start(ROBOT).save())
    for wrong in (b"", saved[:20], saved[:-1], saved + b"x", b"PK" + saved):
        with pytest.raises(ParameterError, match=r"saved"):
            docs["Sketch"]().resume(wrong)


@pytest.mark.parametrize(("engine", "robot"), [(planar, ROBOT), (twin, load_robot("aoi2022"))])
def test_a_record_is_its_owner_s_and_the_walk_goes_on_with_its_own(engine, robot):
    from chilopod.record import Recording

    walk = engine.start(robot, target=(1.0, 1.0), record=Recording(forces=True))
    walk.advance(0.5)
    first = walk.to_dataset()
    kept = first.copy(deep=True)
    for name in first.data_vars:
        if first[name].dtype == np.float64:
            first[name].values[...] = 7.0
    walk.advance(1.0)
    later = walk.to_dataset()
    for name in ("position", "heading", "velocity", "joint_angle", "joint_rate", "leg_yaw", "foot_force", "target"):
        there = later[name].isel(time=slice(kept.sizes["time"])) if "time" in later[name].dims else later[name]
        np.testing.assert_array_equal(there.values, kept[name].values)
