"""The whole robot's studies, shortened: what they find has the shape that rows and figures need."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot
from chilopod.analysis.cycle_modes import CycleMode
from chilopod.analysis.parameters import ALL, stiffness
from chilopod.paper import printed, statements
from chilopod.paper.measures import onset, radius_at, spring_for
from chilopod.paper.robot import walks as robot_walks
from chilopod.paper.robot.figures import turning as turning_figures
from chilopod.paper.robot.figures import walks as walk_figures
from chilopod.paper.robot.rows import turning_rows, walk_rows
from chilopod.paper.robot.turning import RobotTurning
from chilopod.paper.robot.walks import RobotWalks, by_duration, lower_steps, uniform_modes, walk_ends, walk_records
from chilopod.paper.table import Kind, Verdict
from chilopod.paper.turning.trials import turning_task, without_leg_yaw
from chilopod.steering import Target
from chilopod.tasks.radius_law import is_curved
from chilopod.trials import Disturbance

ROBOT = load_robot("aoi2022")

BENT = Disturbance(joint_angle=float(np.deg2rad(5.0)))
"""Walks that begin well bent settle within three quarters of a minute."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("trials")


@pytest.fixture(scope="module")
def records(folder):
    return walk_records(ROBOT, robot_walks.SPRINGS, 2, duration=45.0, disturbance=BENT, folder=folder)


@pytest.fixture(scope="module")
def base(records):
    return walk_ends(records, ROBOT, robot_walks.SPRINGS)


@pytest.fixture(scope="module")
def walks(base, records, folder):
    uniform = uniform_modes(ROBOT, (26.0, 20.0, 17.0), folder=folder)
    examples = xr.Dataset(
        {"joint_angle": (("time", "spring", "joint"), np.linspace(-0.1, 0.3, 30).reshape(3, 2, 5))},
        coords={"time": [0.0, 1.0, 2.0], "spring": [41.0, 15.0], "joint": np.arange(1, 6)},
    )
    names = list(printed.variant_robots(ROBOT))[1:]
    durations = by_duration(records, ROBOT, robot_walks.SPRINGS)
    lower = {"stride 1.8 cm": base}
    return RobotWalks(base, durations, dict.fromkeys(names, base), lower, examples, uniform)


@pytest.fixture(scope="module")
def tasks(folder):
    target, springs = Target.parse("45 deg, 1.3 m"), (15.0, 21.0, 41.0)
    task = turning_task(ROBOT, target, springs, 2, shown=springs, engine="twin", duration=27.0, folder=folder)
    hopf = dataclasses.replace(task)
    without = without_leg_yaw(ROBOT, target, {"paper's spring": 21.0}, duration=6.0, engine="twin", folder=folder)
    return RobotTurning(ROBOT, {"A": task, "B": task}, hopf, without)


@pytest.mark.slow
def test_soft_springs_curve_and_stiff_ones_do_not(base):
    curved = is_curved(base).mean(axis=1)
    assert curved[0] == 1.0
    assert (curved[-2:] == 0.0).all()
    assert (base.status == "walked").all()
    assert radius_at(base, 15.0).value < radius_at(base, 21.0).value
    assert np.isnan(radius_at(base, 75.0).value)
    fit = onset(base)
    assert fit is not None
    assert 26.0 < fit.critical < 45.0
    # The spring for the radius of a spring's own walks is that spring.
    found = spring_for(base, 5 * 0.225 / float(base.bend.sel(spring=21.0).mean()))
    assert found.value == pytest.approx(21.0)
    assert 0.0 < found.error < 2.0
    assert np.isnan(spring_for(base, 0.05).value)


@pytest.mark.slow
def test_walks_cut_short_are_those_that_were_asked_shorter(walks, base):
    found = walks.durations
    assert found.duration.values.tolist() == [20.0, 30.0, 40.0, 45.0]
    assert float(found.onset[-1]) == onset(base, settled=False).critical
    assert found.axis_radius[-1].sel(spring=21.0) == radius_at(base, 21.0, settled=False).value
    short = walk_ends(walk_records(ROBOT, (21.0,), 2, duration=20.0, disturbance=BENT), ROBOT, (21.0,))
    assert float(found.axis_radius.sel(duration=20.0, spring=21.0)) == radius_at(short, 21.0, settled=False).value
    assert (found.curved + found.straight <= 1.0).all()


def test_the_other_reading_of_a_shorter_stride_lifts_the_feet_in_proportion():
    variant = printed.variant_robots(ROBOT)["stride 1.8 cm"]
    lower = lower_steps(ROBOT, variant)
    assert lower.twin.clearance == pytest.approx(0.6 * ROBOT.twin.clearance)
    assert lower.with_value("twin.clearance", ROBOT.twin.clearance).twin == variant.twin
    assert lower.gait == variant.gait


@pytest.mark.slow
def test_softer_uniform_springs_sway_slowly_before_they_undulate(walks):
    """Walks from maps of joint angles once a cycle, computed apart: 16 s and about a minute, at 18.6 and 22.0."""
    undulation, bend = (walks.uniform.sel(mode=mode) for mode in (robot_walks.UNDULATION, robot_walks.BEND))
    assert 17.0 < float(undulation.end) < 20.0 < float(bend.end) < 26.0
    assert 13.0 < float(undulation.period.sel(spring=17.0)) < 19.0
    assert 40.0 < float(bend.period.sel(spring=20.0)) < 90.0
    assert 0.0 < float(undulation.end_error) < 1.0


def test_modes_end_where_their_modulus_passes_one(monkeypatch, tmp_path):
    """Made-up modes: both linear in 1/k, one from 18 on, the other from 24 on, until the walk is lost."""

    def modes(cycle, start, yaw, amplitude, cycles, basis):
        turned = np.exp(1j * np.arange(5))
        found = [(18.0, 0.2, turned, 0.004), (24.0, 0.05, np.ones(5), 0.004 if cycle > 15.0 else 0.2)]
        modes = [CycleMode((1.0 + 1.0 / cycle - 1.0 / at) * np.exp(1j * t), e, v) for at, t, v, e in found]
        return sorted(modes, key=lambda mode: -abs(mode.multiplier)), np.zeros(71), None

    walker = SimpleNamespace(walk_cycle=lambda robot: (robot.get(ALL) / stiffness(1.0), None))
    monkeypatch.setattr(robot_walks, "engine_named", lambda name: walker)
    monkeypatch.setattr(robot_walks, "finite_modes", modes)
    found = uniform_modes(ROBOT, folder=tmp_path / "trials")
    np.testing.assert_allclose(found.end, [18.0, 24.0], rtol=1e-9)
    # Half an interval of 0.004, at one neighbour or both, over a slope of 1 in 1/k.
    assert (found.end_error / found.end**2 > 0.7 * 0.004 / 1.96).all()
    assert (found.end_error / found.end**2 <= 0.004 / 1.95).all()
    np.testing.assert_allclose(found.period.sel(spring=20.0), ROBOT.gait.period * 2.0 * np.pi / np.array([0.2, 0.05]))
    assert np.isnan(found.modulus.sel(mode=robot_walks.BEND, spring=[14.0, 11.0])).all()
    monkeypatch.setattr(robot_walks, "finite_modes", lambda *given: pytest.fail("not kept"))
    assert uniform_modes(ROBOT, folder=tmp_path / "trials").identical(found)


@pytest.mark.slow
def test_rows_and_words_of_the_walks(walks):
    assert {row.statement.kind for row in walk_rows(walks)} == set(Kind)
    assert all(text for panel in walk_figures.panels(walks) for text in panel.text)


@pytest.mark.slow
def test_rows_and_words_of_the_tasks(tasks, walks):
    outcome = tasks.tasks["A"].criteria.outcome
    assert (outcome.sel(spring=21.0) == "arrived").all()
    assert (outcome.sel(spring=41.0) == "bulged outside").any()
    assert (outcome.sel(spring=15.0) == "turned inside").all()
    rows = turning_rows(tasks, walks)
    assert [row.statement for row in rows if row.statement.kind is not Kind.PREDICTED] == [statements.ARRIVAL]
    # Of a strategy beside itself nothing is lower.
    assert next(row for row in rows if row.statement == statements.HOPF).verdict is Verdict.UNDECIDED
    assert rows[0].statement == statements.TASKS["A"].k_hat
    assert all(text for panel in turning_figures.panels(tasks, walks) for text in panel.text)
