"""The harness attacks for some seconds what is cheap to attack; and it finds faults that are planted."""

from pathlib import Path

import pytest

import chilopod.robot
import chilopod.tasks
import in_process
import outcomes
import processors
import run
import workers
from chilopod.planar.walk import PlanarWalk

Kind = outcomes.Kind
SEED = 13
SHORT = {
    "robot-files": (run.RobotFiles(quick=True), 40),
    "arguments": (run.Arguments(quick=True), 20),
    "trials": (run.SavedTrials(quick=True), 15),
    "same-bits": (run.SameBits(), 6),
    "verbs": (run.Verbs(quick=True), 5),
    "invariances": (run.Invariances(), 8),
    "edited-controllers": (run.EditedControllers(), 8),
    "broken-engines": (run.BrokenEngines(), 2),
    "known-constants": (run.KnownConstants(), 1),
}


def attacked(name, folder, count):
    """What got through, of so many attacks of a class in this process."""
    attacks, found = SHORT[name][0], []
    for case in range(count):
        outcome = workers.attempt(attacks, SEED, case, in_process.new_place(folder / "here"))
        if outcome.kind not in outcomes.FINE:
            found.append((outcome.kind, outcome.said, run.again(name, SEED, case)))
    return found


@pytest.mark.parametrize("name", SHORT)
def test_nothing_gets_through(name, tmp_path):
    assert attacked(name, tmp_path, SHORT[name][1]) == []


def test_it_finds_a_fault_of_its_own(tmp_path, monkeypatch):
    def broken(robot):
        raise KeyError("planted")

    monkeypatch.setattr(chilopod.robot, "load_robot", broken)
    assert Kind.TRACEBACK in {kind for kind, _, _ in attacked("robot-files", tmp_path, 3)}


def test_it_finds_what_is_left_behind(tmp_path, monkeypatch):
    load = chilopod.robot.load_robot

    def leaving(robot):
        Path("left").mkdir()
        return load(robot)

    monkeypatch.setattr(chilopod.robot, "load_robot", leaving)
    assert Kind.LEFT in {kind for kind, _, _ in attacked("robot-files", tmp_path, 5)}


def test_it_finds_damaged_trials_that_are_accepted(tmp_path, monkeypatch):
    monkeypatch.setattr("chilopod.netcdf._is_whole", lambda data, content: True)
    assert Kind.WRONG in {kind for kind, _, _ in attacked("trials", tmp_path, 10)}


def test_it_finds_records_that_depend_on_the_batch(tmp_path, monkeypatch):
    walk = chilopod.tasks.walk

    def depending(robot, duration, *, repeats=1, **more):
        done = walk(robot, duration, repeats=repeats, **more)
        done.record["heading"] = done.record.heading + 1e-15 * repeats
        return done

    monkeypatch.setattr(chilopod.tasks, "walk", depending)
    assert Kind.WRONG in {kind for kind, _, _ in attacked("same-bits", tmp_path, 3)}


def test_it_finds_a_walk_that_is_changed_by_a_look(tmp_path, monkeypatch):
    pose = PlanarWalk.pose

    def cutting(walk):
        walk._timeline.cut_at(walk.time)
        return pose(walk)

    monkeypatch.setattr(PlanarWalk, "pose", cutting)
    assert Kind.WRONG in {kind for kind, _, _ in attacked("verbs", tmp_path, 1)}


def test_it_finds_edited_controllers_that_are_the_old_ones(tmp_path, monkeypatch):
    monkeypatch.setattr("chilopod.trials.reach.Reach._parts", lambda *_: iter(()))
    assert Kind.WRONG in {kind for kind, _, _ in attacked("edited-controllers", tmp_path, 5)}


def test_it_finds_broken_engines_that_are_believed(tmp_path, monkeypatch):
    monkeypatch.setattr("chilopod.trials.batch.check_record", lambda data, *asked: data)
    assert Kind.WRONG in {kind for kind, _, _ in attacked("broken-engines", tmp_path, 6)}


@pytest.mark.parametrize(
    ("ending", "kind"),
    [
        (outcomes.Ending(2, "", "error: body.mass = 'x': does not start with a number\n"), Kind.REFUSED),
        (outcomes.Ending(2, "", "error: it does not work\n"), Kind.FIELD),
        (outcomes.Ending(2, "", "error: body.mass = 1: no\nRuntimeWarning: overflow\n"), Kind.LINES),
        (outcomes.Ending(2, "half a result", "error: body.mass = 1: no\n"), Kind.LINES),
        (outcomes.Ending(0, "", "RuntimeWarning: overflow\n"), Kind.LINES),
        (outcomes.Ending(130, "", "error: interrupted\n"), Kind.CODE),
        (outcomes.Ending(-11, "", ""), Kind.CRASH),
        (outcomes.Ending(None, "", "", "KeyError: 1"), Kind.TRACEBACK),
    ],
)
def test_endings_are_told_apart(ending, kind):
    try:
        found = outcomes.judged(ending, {}, {})
    except outcomes.FoundFault as fault:
        found = fault.kind
    assert found is kind


def test_the_same_seed_makes_the_same_attacks(tmp_path):
    def tried():
        place = in_process.new_place(tmp_path / "here")
        workers.attempt(SHORT["arguments"][0], SEED, 3, place)
        return place.tried.read_text()

    assert tried() == tried() != ""


def test_it_finds_verdicts_and_numbers_that_hang_on_the_processor():
    right = [["COMPLETE", [0.0, 0.0], 0.0], ["PITCHFORK", [2.4, 0.0], 1e-12]]
    processors.compare(right, [right[0], ["PITCHFORK", [2.4 + 1.5e-12, 0.0], 1e-12]], "another")
    for other in (
        [["INCOMPLETE", [0.0, 0.0], 0.0], right[1]],
        right[:1],
        [right[0], ["PITCHFORK", [2.4 + 3e-12, 0.0], 1e-12]],
        [right[0], ["PITCHFORK", [float("nan"), 0.0], 1e-12]],
    ):
        with pytest.raises(outcomes.FoundFault):
            processors.compare(right, other, "another")
