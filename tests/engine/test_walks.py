"""What outsiders broke in walks of both engines, and its relatives."""

import copy
import io
import itertools
import json
import pickle
import threading

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot, planar, twin
from chilopod.engine import Command, Event, Status, Targets, event_times, steer
from chilopod.errors import AnalysisError, ChilopodError, ParameterError, ThreadError
from chilopod.planar.walk import TOLERANCE
from chilopod.record import Recording
from chilopod.steering import LegYawController

PLANAR, TWIN = load_robot("aoi2022-planar"), load_robot("aoi2022")
BOTH = pytest.mark.parametrize(("engine", "robot"), [(planar, PLANAR), (twin, TWIN)], ids=["planar", "twin"])
TORN = Command(joint_torque=[[30.0, 0.0, 0.0, 0.0, 0.0]])


def torn(engine, robot, steps):
    walk = engine.start(robot, record=Recording(rate=50.0))
    walk.advance(0.5)
    walk.command(TORN)
    for time in np.linspace(0.5, 2.0, steps + 1)[1:]:
        walk.advance(time)
    return walk


@BOTH
def test_when_and_how_a_robot_ends_does_not_hang_on_how_it_is_advanced(engine, robot):
    whole, pieces = torn(engine, robot, 1), torn(engine, robot, 750)
    assert whole.status == pieces.status == (Status.OUT_OF_RANGE,)
    assert whole.to_dataset().equals(pieces.to_dataset())


@BOTH
def test_the_record_goes_on_when_nobody_walks_any_more(engine, robot):
    data = torn(engine, robot, 3).to_dataset()
    assert data.sizes["time"] == 101
    for name, values in data.data_vars.items():
        if values.dims[:2] == ("time", "robot"):
            assert np.isnan(values.values[-1]).all(), name


@BOTH
@pytest.mark.parametrize("time", [0.0, 0.31, 0.3137, 0.62])  # of the start, a switch, between samples, a cycle
def test_a_robot_is_halted_at_once_and_the_others_never_know(engine, robot, time):
    free, walk = (engine.start([robot, robot], record=Recording(rate=100.0)) for _ in range(2))
    for each in (free, walk):
        each.advance(0.1 * time)
        each.advance(time)
    walk.observe()
    walk.halt(np.array([False, True]))
    walk.aim((1.0, 1.0))
    assert np.isnan(walk.pose()[1]).all()
    np.testing.assert_array_equal(walk.pose()[0], free.pose()[0])
    assert walk.to_dataset().sizes["time"] == free.to_dataset().sizes["time"]
    for each in (free, walk):
        each.advance(0.8)
    data, whole = walk.to_dataset(), free.to_dataset()
    samples = int((whole.time.values <= time + 1e-9).sum())
    for name in ("position", "heading", "joint_angle"):
        np.testing.assert_array_equal(data[name].values[:, 0], whole[name].values[:, 0])
        np.testing.assert_array_equal(data[name].values[:samples, 1], whole[name].values[:samples, 1])
        assert np.isnan(data[name].values[samples:, 1]).all()
    assert walk.status == (Status.WALKED, Status.HALTED)


@BOTH
def test_a_robot_that_failed_is_not_halted(engine, robot):
    walk = torn(engine, robot, 1)
    walk.halt(np.array([True]))
    assert walk.status == (Status.OUT_OF_RANGE,)


@pytest.mark.parametrize("period", ["25 ms", "33 ms", "1 ms", "100 ms"])
def test_what_the_scanner_shows_does_not_hang_on_how_the_robot_is_advanced(period):
    robot = TWIN.override("twin.scanner_period", period)
    seen = []
    for stops in ((0.134,), (0.024, 0.1, 0.134), tuple(np.arange(1, 68) * 0.002)):
        walk = twin.start(robot, target=(1.0, 0.5), seeds=[3])
        for time in stops:
            walk.advance(time)
        seen.append(walk.observe().bearing[0])
    assert seen[0] == seen[1] == seen[2]


def test_the_last_scan_is_never_from_the_future_nor_older_than_its_period():
    robot = TWIN.set_from_text(["twin.scanner_period=25 ms", "twin.scanner_noise=0 mm", "twin.scanner_resolution=0 mm"])
    often = twin.start(robot, target=(1.0, 0.5), initial=twin.initial_states(robot, heading=0.3))
    bearings = []
    for tick in range(200):
        often.advance(tick * 0.002)
        bearings.append(float(often.observe().bearing[0]))
    changes = np.flatnonzero(np.diff(bearings)) + 1
    np.testing.assert_array_equal(changes[:10], [13, 25, 38, 50, 63, 75, 88, 100, 113, 125])


def test_recorded_foot_forces_are_those_that_acted_while_legs_turn_slowly():
    walk = planar.start(PLANAR, record=Recording(rate=2000.0, forces=True), tolerance=1e-12)
    walk.advance(0.05)
    walk.command(Command(leg_yaw=[0.4, 0.4], within=1.0))
    walk.advance(0.25)
    data = walk.to_dataset().isel(time=slice(120, None))
    mass, length = PLANAR.module_mass, PLANAR.module_length
    headings = data.heading.values[:, 0, None] + np.cumsum(
        np.pad(data.joint_angle.values[:, 0], ((0, 0), (1, 0))), axis=1
    )
    ahead = np.stack([np.cos(headings), np.sin(headings)], -1)
    centres = data.position.values[:, 0, None] - 0.5 * length * np.cumsum(
        np.concatenate([np.zeros_like(ahead[:, :1]), ahead[:, :-1] + ahead[:, 1:]], axis=1), axis=1
    )
    acceleration = np.diff(mass * centres.sum(axis=1), n=2, axis=0) * 2000.0**2
    force = data.foot_force.values[1:-1, 0].sum(axis=(1, 2))
    assert np.median(np.abs(acceleration - force)) < 1e-3 * np.abs(force).max()


@BOTH
def test_a_command_of_torques_leaves_the_ramp_of_the_legs_as_it_is(engine, robot):
    walks = [engine.start(robot) for _ in range(2)]
    for walk in walks:
        walk.command(Command(leg_yaw=[0.2, 0.2], within=0.3))
    walks[1].command(Command(joint_torque=[0.0] * 5))
    walks[1].command(Command(stiffness=[robot.springs.stiffness]))
    for walk in walks:
        walk.advance(0.2)
    legs, others = (walk.to_dataset().leg_yaw.values for walk in walks)
    np.testing.assert_array_equal(others, legs)


@BOTH
def test_a_robot_alone_and_in_a_batch_have_the_same_variables(engine, robot):
    names = []
    for robots in ([robot], [robot, robot]):
        walk = engine.start(robots)
        walk.command(Command(leg_yaw=[0.1, 0.1]))
        if len(robots) == 2:
            walk.command(Command(joint_torque=[[0.0] * 5, [0.01] * 5]))
        walk.advance(0.1)
        names.append(set(walk.to_dataset().variables))
    assert names[0] == names[1]


NONSENSE = ["three", None, [0.1], {}, 1j, object()]


@BOTH
def test_nonsense_is_one_line_and_changes_nothing(engine, robot):
    walk = engine.start(robot)
    walk.advance(0.1)
    before = walk.save()
    for value in NONSENSE:
        with pytest.raises(ParameterError):
            walk.advance(value)
        with pytest.raises(ParameterError):
            walk.command(Command(leg_yaw=[0.1, 0.1], within=value))
        if value is not None:
            with pytest.raises(ParameterError):
                walk.command(Command(joint_torque=value, leg_yaw=[0.1, 0.1]))
    for value in (10**400, -(10**400), 1e308, float("nan"), 0.05):
        with pytest.raises(ParameterError):
            walk.advance(value)
    assert walk.save() == before


@BOTH
@pytest.mark.parametrize(
    "arguments",
    [
        {"robots": "aoi2022"},
        {"robots": [None]},
        {"robots": []},
        {"initial": "there"},
        {"friction": {}},
        {"target": "there"},
        {"seeds": 3},
        {"seeds": [1.5]},
        {"seeds": [-1]},
        {"seeds": []},
        {"tolerance": "small"},
        {"tolerance": 0.0},
        {"tolerance": float("nan")},
        {"initial": np.full((2, 3), 1.0)},
        {"friction": np.full((6, 2), -1.0)},
        {"friction": np.full((6, 2), True)},
        {"initial": np.full(16, 1.0, dtype=object)},
        {"target": [[np.inf, 0.0]]},
        {"tolerance": True},
        {"record": 5},
        {"record": True},
        {"expected": "long"},
        {"expected": float("nan")},
        {"expected": -1.0},
        {"expected": True},
    ],
    ids=str,
)
def test_a_start_that_is_none_is_named(engine, robot, arguments):
    with pytest.raises(ParameterError) as caught:
        engine.start(**{"robots": robot, **arguments})
    assert caught.value.field == next(iter(arguments))
    assert "\n" not in str(caught.value)


@BOTH
@pytest.mark.parametrize(
    "arguments",
    [
        {"duration": "1 s"},
        {"duration": None},
        {"duration": float("nan")},
        {"duration": True},
        {"duration": 0.0},
        {"duration": -1.0},
        {"duration": 1e9},
        {"rate": 0.0},
        {"rate": 1e6, "duration": 9e4},
        {"rate": 10**400},
        {"rate": "often"},
        {"forces": np.array([True, False])},
        {"forces": 1},
        {"progress": 5},
        {"initial": np.zeros(13)},
        {"friction": np.zeros((6, 2))},
        {"target": 1.0},
    ],
    ids=str,
)
def test_a_simulation_that_is_none_is_named(engine, robot, arguments):
    with pytest.raises(ParameterError) as caught:
        engine.simulate(robot, **{"duration": 0.01, **arguments})
    assert caught.value.field == next(iter(arguments))
    assert "\n" not in str(caught.value)


@BOTH
def test_what_is_no_robot_is_named(engine, robot):
    for wrong in ("aoi2022", None, 5, [robot]):
        for call in (engine.common, engine.initial_states):
            with pytest.raises(ParameterError, match="robot"):
                call(wrong)


@BOTH
def test_numbers_and_seeds_may_be_numpy_s(engine, robot):
    record, seeds = Recording(rate=np.float32(100.0), forces=np.True_), np.array([3, 4])
    more = {"tolerance": np.float32(1e-6), "expected": np.int64(1), "target": (1.0, 0.0)}
    walk = engine.start(robot, record=record, seeds=seeds, **more)
    walk.advance(np.float64(0.2))
    assert engine.resume(walk.save()).save() == walk.save()


@BOTH
def test_a_walk_goes_on_on_another_floor_as_one_that_never_stopped(engine, robot):
    half, whole = (engine.start(robot, initial=engine.initial_states(robot, 0.03), record=None) for _ in range(2))
    half.advance(2.0 * robot.gait.period)
    whole.advance(4.0 * robot.gait.period)
    rest = {
        friction: engine.start(robot, initial=half.states(), friction=np.full((6, 2), friction)) for friction in (1, 2)
    }
    for walk in rest.values():
        walk.advance(2.0 * robot.gait.period)
    np.testing.assert_allclose(rest[1].states(), whole.states(), rtol=0.0, atol=TOLERANCE)
    assert np.abs(rest[2].states() - whole.states()).max() > 1e-4


def test_a_robot_that_is_put_on_the_floor_anew_sees_with_the_noise_of_its_new_seed():
    first, second = (twin.start(TWIN, target=(1.0, 0.3), seeds=[seed], record=None) for seed in (3, 4))
    first.advance(TWIN.gait.period)
    first.restart(np.array([True]), twin.initial_states(TWIN), seeds=[4])
    first = twin.resume(first.save())
    for ahead in (0.0, 0.15):
        first.advance(TWIN.gait.period + ahead)
        second.advance(ahead)
        np.testing.assert_allclose(first.observe().bearing, second.observe().bearing, rtol=0.0, atol=1e-9)
    with pytest.raises(ParameterError, match="no noise"):
        twin.start(TWIN, record=None).restart(np.array([True]), twin.initial_states(TWIN), seeds=[4])


@BOTH
@pytest.mark.parametrize(
    "arguments",
    [
        {"joint_angles": [0.1] * 4},
        {"joint_angles": "bent"},
        {"joint_angles": float("nan")},
        {"heading": [[0.1]]},
        {"position": 0.1},
        {"position": [0.0, 0.0, 0.0]},
        {"heading": [0.1, 0.2], "position": np.zeros((3, 2))},
    ],
    ids=str,
)
def test_a_state_that_is_none_is_named(engine, robot, arguments):
    with pytest.raises(ParameterError):
        engine.initial_states(robot, **arguments)


@BOTH
def test_what_was_saved_and_edited_is_no_walk(engine, robot):
    import hashlib

    walk = engine.start(robot, target=(1.0, 0.0))
    walk.advance(0.1)
    saved = walk.save()
    head, content = saved[:16], saved[48:]
    with np.load(io.BytesIO(content), allow_pickle=False) as read:
        arrays = dict(read)
    header = json.loads(str(arrays["header"]))

    def edited(arrays):
        body = io.BytesIO()
        np.savez(body, **arrays)
        return head + hashlib.sha256(body.getvalue()).digest() + body.getvalue()

    assert engine.resume(edited(arrays)).save() == saved
    for name in arrays:
        with pytest.raises(ChilopodError):
            engine.resume(edited({key: each for key, each in arrays.items() if key != name}))
    for key in header["settings"]:
        settings = {**header["settings"], key: {"a": "dict"}}
        with pytest.raises(ChilopodError):
            engine.resume(edited(arrays | {"header": np.array(json.dumps({**header, "settings": settings}))}))
    for wrong in (None, 3, "text", bytearray(b"x"), b""):
        with pytest.raises(ParameterError):
            engine.resume(wrong)


@BOTH
@pytest.mark.parametrize("made", [copy.copy, copy.deepcopy, lambda walk: pickle.loads(pickle.dumps(walk))])
def test_a_copy_of_a_walk_is_a_walk_of_its_own(engine, robot, made):
    walk = engine.start(robot, target=(1.0, 0.0), seeds=[3])
    walk.advance(0.37)
    other = made(walk)
    walk.command(Command(leg_yaw=[0.1, 0.1]))
    walk.advance(0.9)
    assert other.time == 0.37
    other.command(Command(leg_yaw=[0.1, 0.1]))
    other.advance(0.9)
    assert other.save() == walk.save()


@BOTH
def test_numbers_that_would_overflow_are_named(engine, robot):
    for wrong in ({"friction": np.full((robot.body.modules, 2), 1e308)}, {"target": (1e200, 0.0)}):
        with pytest.raises(ParameterError, match=r"is too large; allowed: numbers up to 1e\+100"):
            engine.start(robot, **wrong)
    with pytest.raises(ParameterError, match=r"must be finite; allowed: numbers up to 1e\+100"):
        engine.start(robot, friction=np.full((robot.body.modules, 2), np.inf))
    with pytest.raises(ParameterError, match=r"is too large; allowed: numbers up to 1e\+100"):
        engine.initial_states(robot, heading=1e300)


@BOTH
def test_controllers_that_are_none_are_named(engine, robot):
    class Asked:
        def __init__(self, phase=0.5, answer=None, error=None, window=0.1):
            self.phase, self.answer, self.error, self.window = phase, answer, error, window

        def events(self, gait):
            return [Event("now", self.phase, self.window)]

        def act(self, event, seen):
            if self.error:
                raise self.error
            return self.answer

    for controller, words in (
        (Asked(phase=1.0), "Asked.events"),
        (Asked(phase="half"), "Asked.events"),
        (Asked(phase=None), "Asked.events"),
        (Asked(window=-1.0), "window.*0 s or more"),
        (Asked(window=np.nan), "window.*0 s or more"),
        (Asked(answer=3), "Asked.command"),
        (Asked(answer=Command(leg_yaw=[np.nan, 0.0])), "Asked.command.leg_yaw"),
        (Asked(answer=Command(stiffness=[1e300] * 5)), "Asked.command.stiffness: is too large"),
        (Asked(error=ZeroDivisionError("by\nnothing")), "ZeroDivisionError: by nothing"),
    ):
        with pytest.raises((ParameterError, AnalysisError), match=words) as caught:
            steer(engine.start(robot), 1.0, controller)
        assert "\n" not in str(caught.value)
    with pytest.raises(ParameterError, match="until"):
        steer(engine.start(robot), float("nan"))
    with pytest.raises(ParameterError, match="bearing_noise"):
        steer(engine.start(robot), 1.0, Asked(answer=Command()), bearing_noise=np.zeros((2, 9)))
    with pytest.raises(ParameterError, match="bearing_noise"):
        steer(engine.start(robot), 9.0, Asked(answer=Command()), bearing_noise=np.zeros((1, 2)))


@BOTH
@pytest.mark.parametrize(
    "verb", ["advance", "observe", "pose", "states", "save", "to_dataset", "command", "aim", "halt"]
)
def test_a_thread_is_refused_while_another_is_within_a_verb(engine, robot, verb, monkeypatch):
    arguments = {
        "advance": (0.2,),
        "command": (Command(leg_yaw=(0.1, 0.1)),),
        "aim": ((1.0, 0.0),),
        "halt": (np.array([True]),),
    }
    walk = engine.start(robot)
    walk.advance(0.05)
    within, on = threading.Event(), threading.Event()

    def waiting(self):
        within.set()
        on.wait(10.0)
        return np.zeros(1, dtype=bool)

    # Any verb of the other thread that takes a while.
    monkeypatch.setattr(Targets, "there", property(waiting))
    monkeypatch.setattr(Targets, "move", lambda self, time, target: waiting(self))
    other = threading.Thread(target=walk.aim, args=((1.0, 1.0),))
    other.start()
    assert within.wait(10.0)
    with pytest.raises(ThreadError, match=f"walk.{verb}: must not run while another thread") as caught:
        getattr(walk, verb)(*arguments.get(verb, ()))
    assert "\n" not in str(caught.value)
    assert walk.time == 0.05
    on.set()
    other.join()
    # Then it is free, for whoever comes.
    done = threading.Thread(target=walk.advance, args=(0.1,))
    done.start()
    done.join()
    assert walk.time == 0.1
    monkeypatch.undo()
    walk.observe()


@BOTH
def test_a_verb_that_is_refused_leaves_the_walk_to_the_next_thread(engine, robot):
    walk = engine.start(robot)
    with pytest.raises(ParameterError):
        walk.advance(-1.0)
    thread = threading.Thread(target=walk.advance, args=(0.02,))
    thread.start()
    thread.join()
    assert walk.time == 0.02


def test_a_command_between_two_cuts_whose_times_were_added_up():
    walk = planar.start(PLANAR, initial=planar.initial_states(PLANAR, joint_angles=0.01))
    walk.advance(0.77)
    walk.command(Command(leg_yaw=[0.02, 0.02]))
    walk.advance(5.3)
    assert np.isfinite(walk.observe().joint_angles).all()


@pytest.mark.parametrize("rate", [None, 100.0])
@pytest.mark.parametrize("beside", [0.0, 1e-16, -1e-16, 1e-12, -1e-12, 9e-11, -9e-11, 1.1e-10, -1.1e-10, 1e-9, -2e-9])
def test_times_beside_cuts_are_like_any_other(rate, beside):
    record = None if rate is None else Recording(rate=rate)
    switches = [*PLANAR.gait.schedule(6).times[1:], 0.05, 0.1]
    for time in (float(switch) + PLANAR.gait.period for switch in switches):
        walk, once = (planar.start(PLANAR, initial=planar.initial_states(PLANAR, 0.02), record=record) for _ in "ab")
        for ahead in (0.3, time - 1e-6, time - 1e-11, time):
            walk.advance(min(ahead, time + beside))
            walk.observe()
        for each in (walk, once):
            each.advance(time + beside)
            each.command(Command(leg_yaw=(0.1, 0.1)))
            each.advance(time + beside + 0.2)
        assert walk.save() == once.save()
        assert len(walk.to_dataset().time) == (0 if record is None else len(record.samples(walk.time)))


@pytest.mark.parametrize("beside", [0.0, 1e-12, -1e-12, 5e-10, -5e-10])
def test_a_robot_put_on_the_floor_anew_beside_the_beginning_of_a_cycle_leaves_the_others_alone(beside):
    walk, once = (planar.start([PLANAR] * 2, initial=planar.initial_states(PLANAR, 0.02), record=None) for _ in "ab")
    for each in (walk, once):
        each.advance(3 * PLANAR.gait.period + beside * PLANAR.gait.period)
    walk.restart(np.array([True, False]), planar.initial_states(PLANAR))
    for each in (walk, once):
        each.command(Command(leg_yaw=(0.1, 0.1)))
        each.advance(4.2 * PLANAR.gait.period)
    np.testing.assert_array_equal(walk.states()[1], once.states()[1])


@pytest.mark.parametrize("duration", [float("nan"), float("inf"), -1.0, "1 s"])
def test_events_are_those_of_a_finite_time(duration):
    with pytest.raises(ParameterError, match="duration = "):
        event_times(LegYawController(), PLANAR.gait, duration)


def test_events_that_never_end_are_refused():
    class Endless:
        def events(self, gait):
            return (Event("again", 0.5, 0.1) for _ in itertools.count())

        def act(self, event, seen):
            return Command()

    with pytest.raises(ParameterError, match=r"Endless.events.*must be fewer.*10000 in a gait cycle"):
        steer(planar.start(load_robot("aoi2022-planar")), 1.0, Endless())


ASKED = {
    "pose": lambda walk: walk.pose(),
    "observe": lambda walk: walk.observe().joint_angles,
    "states": lambda walk: walk.states(),
    "aim": lambda walk: walk.aim((0.5, -1.0)),
    "halt": lambda walk: (walk.halt(np.array([False, True])), walk.pose())[1],
    "halt all": lambda walk: (walk.halt(np.array([False, True])), walk.halt(np.array([True, True])))[1],
    "command": lambda walk: walk.command(Command(joint_torque=0.01 * np.ones(5))),
    "torn": lambda walk: walk.command(TORN),
    "record": lambda walk: walk.to_dataset().heading.values,
    "status": lambda walk: [each.value for each in walk.status],
}


def foreseen(ask, time, until):
    """A walk of two robots that is computed ahead from 0.33 s on, and asked at a time before."""
    states = planar.initial_states(PLANAR, 0.02 * np.ones((2, 5)), [0.0, 0.3])
    walk = planar.start(PLANAR, initial=states, target=(0.9, 0.4), record=Recording(rate=20.0))
    walk.advance(0.33)
    walk.command(Command(leg_yaw=[0.05, 0.05], within=0.1))
    if until is not None:
        walk.foresee(until)
    for each in (0.35, time):
        walk.advance(each)
        walk.pose()
    found, saved = ask(walk), planar.resume(walk.save()).to_dataset()
    for each in (0.71, 1.3):
        walk.advance(each)
        walk.command(Command(joint_torque=-0.01 * np.ones(5)))
    walk.advance(1.5)
    return found, saved, walk.to_dataset()


@pytest.mark.parametrize("time", [0.4, 0.47, 0.6, 0.71])  # at a sample, between, at a switch, at a command
@pytest.mark.parametrize("ask", ASKED)
def test_a_walk_computed_ahead_is_the_same_whatever_is_asked_on_the_way(ask, time):
    found, *records = foreseen(ASKED[ask], time, None)
    for until in (0.71, 1.0):
        again, *others = foreseen(ASKED[ask], time, until)
        np.testing.assert_array_equal(again, found)
        for here, there in zip(others, records, strict=True):
            xr.testing.assert_identical(here, there)
