"""Turning tasks: what becomes of them, where their criteria have minima, and that a killed study goes on."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from chilopod.errors import ParameterError
from chilopod.paper import statements
from chilopod.paper.section import Context, Size
from chilopod.paper.table import OfPlanar, Row, Verdict
from chilopod.paper.turning.figures import criteria
from chilopod.paper.turning.sections import rows
from chilopod.paper.turning.study import all_lower, minima, turning
from chilopod.paper.turning.trials import CRITERIA, springs_by_outcome, turning_task
from chilopod.robot import load_robot
from chilopod.steering import Outcome, Target
from chilopod.trials import NONE
from helpers import made_up_robot

ROBOT = load_robot("aoi2022-planar")
TASK_A = Target.parse("45 deg, 1.3 m")


@pytest.fixture(scope="module")
def found(kept):
    return turning(Context(size=Size.TINY, folder=kept))


def test_stiff_springs_bulge_outside_soft_ones_turn_inside_and_those_between_arrive(found):
    """The paper's picture for both tasks; in the planar model at 8 to 11 and at 10 to 13 N*mm/deg."""
    for letter, softest, stiffest in (("A", 8.0, 11.0), ("B", 10.0, 12.0)):
        springs = springs_by_outcome(found.tasks[letter].criteria)
        arrived = springs[Outcome.ARRIVED]
        assert (min(arrived), max(arrived)) == (softest, stiffest), letter
        assert min(springs[Outcome.OUTSIDE]) > stiffest
        assert max(springs[Outcome.INSIDE]) < softest


def test_the_evaluation_time_is_the_earliest_arrival_of_all(found):
    for task in found.tasks.values():
        assert task.time == float(np.nanmin(task.criteria.arrival.values))
        assert task.criteria.seconds.values[:2].tolist() == [task.time, 23.0]
    assert found.hopf.time == found.tasks["A"].time


def test_minima_lie_between_bulging_outside_and_turning_inside(found):
    for task in found.tasks.values():
        at, springs = minima(task.criteria)["at"], springs_by_outcome(task.criteria)
        for name in ("distance", "angle"):
            assert max(springs[Outcome.INSIDE]) < float(at.sel(criterion=name)) < min(springs[Outcome.OUTSIDE])
        assert float(task.criteria.spring[0]) < float(at.sel(criterion="effort_until_arrival"))


def test_every_minimum_of_the_pitchfork_lies_below_that_of_hopf(found):
    ours, theirs = minima(found.tasks["A"].criteria), minima(found.hopf.criteria)
    assert (ours["mean"] < theirs["mean"]).all()


def test_without_leg_yaw_both_sides_occur_and_none_arrives(found):
    data = found.without
    alone = data.isel(case=~data.leg_yaw.values)
    assert (np.isfinite(alone.arrived).sum("trial") == 9).all()
    assert not alone.arrived.any()
    assert (alone.turned > 0).any("trial").all()
    assert (alone.turned < 0).any("trial").all()
    assert data.arrived.isel(case=1).sum() == 5  # the best spring, with leg yaw


def test_the_law_s_spring_leads_to_the_target_if_the_walk_is_bent_from_the_start(found):
    """Without leg yaw, and with the angle at which module 1 moves on its curve taken into account."""
    nearest = found.settled.start_nearest
    assert (nearest.sel(start="bent, aimed") < 0.03).all()
    assert (nearest.sel(start="bent") < 0.2).all()
    assert (nearest.sel(start="straight") > 0.9).all()
    k_hat, _ = found.laws.k_hat(TASK_A.radius)
    assert 8.0 < k_hat < 12.0
    assert found.laws.k_hat(0.5)[0] == pytest.approx(10.7, abs=0.3)  # r = 0.544 and 0.425 m at 11 and 10 (long walks)


def test_repeats_with_their_mean_and_standard_error():
    task = turning_task(ROBOT, TASK_A, (9.0, 10.0), repeats=3, duration=17.0, shown=(9.0,))
    data = task.criteria
    values = data.distance.values
    # The walks are over before the paper's 23 s.
    assert np.isnan(values[1]).all()
    assert data.distance_mean.values == pytest.approx(values.mean(axis=2), nan_ok=True)
    assert data.distance_error.values == pytest.approx(values.std(axis=2, ddof=1) / np.sqrt(3), nan_ok=True)
    assert len(np.unique(values[0, 0])) == 3
    one = task.paths.isel(shown=0, repeat=1)
    x, y = TASK_A.position
    assert one.distance.values == pytest.approx(np.hypot(one.x - x, one.y - y), abs=1e-12)
    assert float(one.distance.min()) == pytest.approx(float(data.nearest[0, 1]), abs=2e-3)
    assert data.isel(instant=0).to_dataframe().notna().to_numpy()[:, :3].all()


def test_undisturbed_repeats_are_the_same_and_strategies_need_a_name():
    task = turning_task(ROBOT, TASK_A, (20.0,), repeats=2, duration=3.0, disturbance=NONE, shown=(20.0,))
    assert float(task.criteria.distance.std("repeat").max()) == 0.0
    assert np.isnan(task.criteria.attrs["earliest_arrival_s"])
    assert task.time == 3.0  # nobody arrives: at the end
    with pytest.raises(ParameterError, match="pitchfork"):
        turning_task(ROBOT, TASK_A, (20.0,), strategy="pitchfrok")


def made_up(springs, means, wiggle):
    """Criteria of three repeats about means over 1/k1, with the outcomes of a proper task."""
    values = np.asarray(means)[:, None] + wiggle * np.array([-1.0, 0.0, 1.0])
    data = xr.Dataset(coords={"spring": np.asarray(springs, float)})
    data["seconds"] = ("instant", [10.0, 23.0])
    for name in CRITERIA:
        over = ("spring", "repeat") if name.startswith("effort_until") else ("instant", "spring", "repeat")
        data[name] = (over, values if len(over) == 2 else np.stack([values, values + 1.0]))
        data[f"{name}_mean"] = data[name].mean("repeat", skipna=False)
        data[f"{name}_error"] = data[name].std("repeat", ddof=1, skipna=False) / np.sqrt(3.0)
    labels = np.full((len(springs), 3), Outcome.ARRIVED.label, dtype=object)
    labels[0], labels[-1] = Outcome.INSIDE.label, Outcome.OUTSIDE.label
    data["outcome"] = (("spring", "repeat"), labels)
    return data


def test_a_parabola_in_compliance_is_found_exactly():
    springs = np.array([5.0, 7.0, 9.0, 11.0, 15.0, 30.0])
    means, wiggles = 0.2 + 30.0 * (1.0 / springs - 1.0 / 9.7) ** 2, 1e-4 * np.arange(1.0, 7.0)[:, None]
    low = minima(made_up(springs, means, wiggles)).sel(criterion="distance")
    assert float(low["at"]) == pytest.approx(9.7, rel=1e-9)
    assert float(low.spring) == 9.0
    assert float(low["mean"]) == pytest.approx(0.2 + 30.0 * (1.0 / 9.0 - 1.0 / 9.7) ** 2)
    assert (float(low.softest), float(low.stiffest), float(low.alike)) == (9.0, 9.0, 1.0)
    in_step = minima(made_up(springs, means, 1e-4)).sel(criterion="distance")  # differences that do not scatter
    assert (float(in_step.softest), float(in_step.stiffest)) == (5.0, 30.0)


@pytest.mark.parametrize("repeats", [3, 10])
def test_the_best_of_many_springs_alike_is_no_better_than_the_best_of_few(repeats):
    outcomes, sets = dict.fromkeys(range(8, 20), Outcome.ARRIVED.label), 20
    decided, kept = [], []
    for seed in range(sets):
        many = made_up_robot.task(range(8, 20), 12.0, {}, outcomes, wiggle=1e3, repeats=repeats, seed=seed)
        one = made_up_robot.task((12,), 12.0, {}, outcomes, wiggle=1e3, repeats=repeats, seed=sets + seed)
        decided += [all_lower(many, one).answer is not None, all_lower(one, many).answer is not None]
        kept += [float(each) for each in minima(many.criteria)["alike"]]
    assert np.mean(decided) < 0.07
    assert np.mean(kept) > 0.9 * 12


def test_a_minimum_at_the_end_of_the_springs_is_there():
    springs = np.array([5.0, 7.0, 9.0, 11.0])
    low = minima(made_up(springs, springs, 0.1)).sel(criterion="angle")
    assert float(low["at"]) == 5.0


def test_springs_where_a_walk_failed_have_no_mean():
    data = made_up([5.0, 7.0, 9.0, 11.0], [np.nan, 0.3, 0.2, 0.4], 0.01)
    low = minima(data).sel(criterion="distance")
    assert float(low.spring) == 9.0
    assert np.isnan(minima(made_up([5.0, 7.0, 9.0], [np.nan] * 3, 0.0))["at"]).all()


def test_geometry_is_held_against_the_paper_and_walks_stand_beside_the_robot(found):
    table = rows(found)
    judged = [row for row in table if isinstance(row, Row) and row.verdict != Verdict.NOT_PRINTED]
    assert [(row.paper, row.computed.words, row.verdict) for row in judged] == [
        ("0.88 m", "0.919 m", "differs"),
        ("1.2 m", "1.167 m", "agrees"),
    ]
    beside = {row.statement: row.result.words for row in table if isinstance(row, OfPlanar)}
    tasks = [each for task in statements.TASKS.values() for each in (task.k_hat, task.outcomes, *task.minima.values())]
    others = {statements.ARRIVAL, statements.WITHOUT, statements.HOPF, statements.HOPF_SPRINGS}
    assert set(beside) == {*tasks, *others}
    assert not any("nan" in words for words in beside.values())
    assert beside[statements.HOPF] == "1 of 3 lower, 2 of 3 undecided"
    assert beside[statements.WITHOUT].startswith("0 of 9 arrive")


def test_tasks_that_are_swapped_are_noticed(found):
    swapped = replace(found, tasks={"A": found.tasks["B"], "B": found.tasks["A"]})
    here, there = (
        {row.statement: row.result.words for row in rows(each) if isinstance(row, OfPlanar)}
        for each in (found, swapped)
    )
    first, second = statements.TASKS.values()
    for one, other in ((first.k_hat, second.k_hat), (first.outcomes, second.outcomes)):
        assert (there[one], there[other]) == (here[other], here[one])
        assert there[one] != here[one]
    assert [row.verdict for row in rows(swapped)[:2]] == ["differs", "differs"]


STUDY = """
import sys
from chilopod.robot import load_robot
from chilopod.steering import Target
from chilopod.paper.turning.trials import turning_task
def study(folder):
    robot, target = load_robot("aoi2022-planar"), Target.parse("45 deg, 1.3 m")
    return turning_task(robot, target, range(8, 18), repeats=4, duration=4.0, folder=folder)
"""


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.glob("planar-*.nc")}


def test_a_killed_study_goes_on_and_gives_the_same_bits(tmp_path):
    """Killed with one thread and finished here, with more, against one that ran through."""
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    names = {}
    exec(STUDY, names)
    study = names["study"]
    expected = study(whole).criteria

    running = subprocess.Popen(
        [sys.executable, "-c", f"{STUDY}study(sys.argv[1])", str(killed)], env={**os.environ, "NUMBA_NUM_THREADS": "1"}
    )
    deadline = time.monotonic() + 60.0
    while len(list(killed.glob("planar-*.nc"))) < 10 and time.monotonic() < deadline:
        time.sleep(0.005)
    running.send_signal(signal.SIGKILL)
    running.communicate()
    before = {path.name: path.stat().st_mtime_ns for path in killed.glob("planar-*.nc")}
    assert 10 <= len(before) < 40  # in the middle

    result = study(killed).criteria
    after = {path.name: path.stat().st_mtime_ns for path in killed.glob("planar-*.nc")}
    assert len(after) == 40
    assert {name: after[name] for name in before} == before
    assert contents(killed) == contents(whole)
    xr.testing.assert_identical(result, expected)


def test_findings_of_another_robot(found):
    """Where nothing arrives the words still hold."""
    stiff = turning_task(ROBOT, TASK_A, (60.0, 75.0), repeats=2, duration=5.0, shown=(60.0, 60.0, 75.0))
    assert springs_by_outcome(stiff.criteria)[Outcome.ARRIVED] == []
    table = rows(replace(found, tasks={"A": stiff, "B": found.tasks["B"]}))
    assert next(row.result.words for row in table if getattr(row, "statement", None) == statements.TASKS["A"].outcomes)


@pytest.mark.parametrize(("k_hat", "below"), [(30.0, True), (10.0, False)])
def test_only_minima_below_the_law_s_spring_have_a_reason(k_hat, below):
    springs = (15.0, 17.0, 21.0, 28.0, 41.0)
    task = made_up_robot.task(springs, 21.0, {}, dict.fromkeys(springs, Outcome.ARRIVED.label))
    found = SimpleNamespace(tasks={"A": task}, laws=SimpleNamespace(k_hat=lambda radius: (k_hat,)))
    assert ("grows fast enough" in " ".join(criteria(found, "A").text)) is below
