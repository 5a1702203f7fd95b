"""The planar model's constants from recorded walks."""

import json
import re

import numpy as np
import pytest
import xarray as xr

from chilopod.cli import main
from chilopod.errors import ChilopodError
from chilopod.netcdf import netcdf
from chilopod.planar import PlanarModel, initial_states, simulate
from chilopod.planar.model import states_at
from chilopod.robot import Robot, load_robot
from chilopod.tasks.identify import RecordedWalks, identify_recorded, trajectories
from chilopod.tasks.identify.constants import Estimates, FreeConstants
from chilopod.tasks.identify.recordings import read_recordings

ROBOT = load_robot("aoi2022-planar")
FREE = {"ground.friction": (100.0, 500.0), "legs.half_width": (0.03, 0.15), "legs.forward_offset": (0.0, 0.1)}
SPRING = "springs.stiffness[0]=9 N*mm/deg"
SOFT = ROBOT.set_from_text([SPRING])
START = initial_states(SOFT, [0.3, 0.15, 0.15, 0.1, 0.05])


def walked(robot, seconds, rate=20.0):
    return simulate(robot, seconds, initial=START, rate=rate, tolerance=1e-9)


def as_csv(times, angles, head="time [s]" + ",joint [deg]" * 5):
    rows = [
        ",".join("" if np.isnan(x) else f"{x:.4f}" for x in (t, *row)) for t, row in zip(times, angles, strict=True)
    ]
    return "\n".join([head, *rows])


def data(*files, free=FREE, **more):
    return RecordedWalks(free=free, trajectory=[{"file": each, "settings": [SPRING], **more} for each in files])


def test_states_at_any_times_are_those_of_a_simulation():
    record = walked(SOFT, 2.0)
    there = np.array([0, 3, 6, 7, 40])  # 6 and 12 are switches of the gait
    states = states_at([PlanarModel(SOFT)], np.repeat(START, 2, axis=0), 0.0, record.time.values[there], 1e-9)
    for each in np.moveaxis(states, 1, 0):
        np.testing.assert_allclose(each[:, 3:8], record.joint_angle.values[there, 0], atol=1e-8)


def test_intervals_cover_the_constants_of_robots_that_are_recorded_from_any_moment(tmp_path):
    covered = []
    rng, robot = np.random.default_rng(1), SOFT
    for path in FREE:
        robot = robot.with_value(path, ROBOT.get(path) * 1.2 ** rng.uniform(-1.0, 1.0))
    record = walked(robot, 25.0, 100.0).isel(time=slice(int(rng.integers(300)), None, 5))
    angles = np.rad2deg(record.joint_angle.values[:, 0]) + rng.normal(0.0, 0.5, (record.time.size, 5))
    angles[rng.uniform(size=angles.shape) < 0.1] = np.nan
    rows = rng.uniform(size=len(angles)) > 0.1
    (tmp_path / "walk.csv").write_text(as_csv(record.time.values[rows], angles[rows]))
    found = identify_recorded(ROBOT, data("walk.csv"), tmp_path)
    assert found.scatter == pytest.approx(np.deg2rad(0.5), rel=0.05)
    for path, each in found.as_json()["constants"].items():
        assert each["value_si"] == pytest.approx(robot.get(path), rel=0.01)
        covered.append(each["interval_si"][0] <= robot.get(path) <= each["interval_si"][1])
    assert sum(covered) >= 2  # by chance fewer of three in one of thirty-five


@pytest.mark.parametrize("first", [0, 11])
def test_a_walk_is_identified_from_its_release_or_any_later_moment(tmp_path, first):
    # Where both legs of a module are up, joints swing for some time after the release.
    robot = SOFT.set_from_text(["gait.side_phase=150 deg"])
    record = walked(robot, 3.4, 50.0).isel(time=slice(first, None, 2))
    (tmp_path / "walk.nc").write_bytes(netcdf(record))
    given = RecordedWalks(
        free={"ground.friction": FREE["ground.friction"]}, trajectory=[{"file": "walk.nc", "settings": [SPRING]}]
    )
    found = identify_recorded(robot.with_value("ground.friction", 235.0), given, tmp_path)
    assert found.scatter < 1e-7
    assert "alike" not in str(found)  # what is left is rounding
    assert found.as_json()["phases"] == pytest.approx([first / 50.0 / robot.gait.period], abs=1e-5)
    assert found.best.get("ground.friction") == pytest.approx(ROBOT.get("ground.friction"), rel=1e-6)


def test_a_heavy_robot_remembers_its_rates_for_cycles(tmp_path):
    robot = SOFT.set_from_text(["body.mass=85 kg"])
    record = walked(robot, 6.0, 50.0).isel(time=slice(11, None, 2))
    given = RecordedWalks(
        free={"ground.friction": FREE["ground.friction"]}, trajectory=[{"file": "walk.nc", "settings": [SPRING]}]
    )
    (tmp_path / "walk.nc").write_bytes(netcdf(record))
    found = identify_recorded(robot.with_value("ground.friction", 240.0), given, tmp_path)
    assert found.best.get("ground.friction") == pytest.approx(ROBOT.get("ground.friction"), rel=1e-4)
    (recording,) = read_recordings(robot, given, tmp_path)
    assert recording.forgotten > robot.gait.period
    poor = robot.set_from_text(["ground.friction=30 N*s/m"])
    with pytest.raises(ChilopodError, match=r"too short for this robot, which forgets .* or more"):
        read_recordings(poor, given, tmp_path)


def test_friction_and_springs_are_known_as_their_ratio_alone(tmp_path):
    robot = ROBOT.set_from_text(["springs.stiffness=12 N*mm/deg"])
    record = walked(robot, 5.0).isel(time=slice(20, None))
    for seed, name in enumerate(("walk.nc", "again.nc")):
        noise = np.random.default_rng(seed).normal(0.0, 0.01, record.joint_angle.shape)
        (tmp_path / name).write_bytes(netcdf(record.assign(joint_angle=record.joint_angle + noise)))
    free = {"ground.friction": ("150 N*s/m", "350 N*s/m"), "springs.stiffness": ("8 N*mm/deg", "16 N*mm/deg")}
    files = [{"file": "walk.nc"}, {"file": "again.nc"}]
    walks = RecordedWalks(free={**free, "body.mass": (2.0, 20.0)}, trajectory=files)
    found = identify_recorded(robot, walks, tmp_path).as_json()
    known, _, wide = found["combinations"]
    assert max(map(abs, known["changes"].values())) < 0.05
    assert known["changes"]["ground.friction"] == pytest.approx(-known["changes"]["springs.stiffness"], rel=0.1)
    assert wide["open"]
    assert found["constants"]["body.mass"]["interval_text"].endswith("(left open by the data)")


def test_changes_of_a_constant_that_is_about_zero_are_relative_to_its_range():
    free = FreeConstants.read({"springs.damping": ["0 N*m*s/rad", "1 N*m*s/rad"], "legs.half_width": (0.03, 0.15)})
    values, spread = np.array([1.3e-21, 0.07]), np.diag([0.02, 0.007]) ** 2
    found = trajectories.RecordedIdentification(
        Estimates(ROBOT, free, values, np.array([[0.0, 0.02], [0.063, 0.077]]), spread),
        xr.Dataset(),
        (),
        0.0,
        1.0,
        True,
    )
    known = found.as_json()
    assert known["of_range"] == ["springs.damping"]
    assert [max(each["changes"].values()) for each in known["combinations"]] == pytest.approx([0.02, 0.1])
    _, cells, said = found._content()
    assert cells[1][1:] == ("0 N*m*s/rad", "0 N*m*s/rad to 0.02 N*m*s/rad (lower end cut by the range searched)")
    assert "springs.damping +2 % of its range" in said[1]
    assert said[2].endswith("legs.half_width +10 %")


def test_a_recording_in_rad_that_is_called_deg_is_hinted_at():
    free = FreeConstants.read({"ground.friction": ["100 N*s/m", "500 N*s/m"]})
    estimates = Estimates(ROBOT, free, np.array([236.0]), np.array([[100.0, 389.0]]), np.array([[144.0**2]]))

    def found(degrees):
        angles = np.deg2rad(degrees)
        walks = xr.Dataset({"measured": (("sample", "joint"), np.array([[angles, np.nan]]))})
        return trajectories.RecordedIdentification(estimates, walks, (0.0,), 2e-3, 305.0, True)

    _, cells, said = found(-0.53)._content()
    assert cells[1][2].startswith("100 N*s/m to 389 N*s/m")  # no power of ten
    assert "the model or the recording is off; intervals are 17.5 times as wide" in said[-2]
    assert said[-1] == "no joint angle exceeds 0.53 deg: numbers in rad must have the unit rad"
    assert "in rad" not in " ".join(found(30.0)._remarks())


def test_residuals_that_are_alike_enlarge_variances():
    rng = np.random.default_rng(1)
    off = rng.normal(size=(20000, 5))
    assert trajectories._alike(off) == pytest.approx(1.0, abs=0.05)
    for row in range(1, len(off)):
        off[row] += 0.8 * off[row - 1]
    off[rng.uniform(size=off.shape) < 0.2] = np.nan
    assert trajectories._alike(off) == pytest.approx(9.0, rel=0.15)


TIMES = 0.05 * np.arange(200)
ANGLES = np.full((200, 5), 10.0)


@pytest.mark.parametrize(
    ("text", "unit", "said"),
    [
        (as_csv(TIMES, np.nan * ANGLES), None, r"0 angles in 0 s.*allowed: 3 s \(5 cycles of the gait\)"),
        (as_csv(TIMES[:30], ANGLES[:30]), None, "150 angles in 1.45 s"),
        (as_csv(TIMES, ANGLES[:, :4], "time,a [deg],b [deg],c [deg],d [deg]"), None, "columns = 4: must be 5 besides"),
        (as_csv(TIMES, ANGLES, "time,a,b,c,d,e"), "rad", "column a = '10 rad': too large: sample 1, line 2.*degrees"),
        (
            "# from the lab\n" + as_csv(TIMES, ANGLES).replace("10.0000\n", "-104.0000\n", 1), None,
            r"column joint \[deg\] = '-104 deg': too large: sample 1, line 3; allowed: at most 90 deg$",
        ),
        (as_csv(TIMES, ANGLES, "time,a,b,c,d,e"), None, "column = 'a': must have a unit"),
        (as_csv(TIMES, ANGLES, "time [deg],a,b,c,d,e"), "deg", r"column = 'time \[deg\]': must have a unit"),
        (
            as_csv(TIMES, ANGLES, ",".join(["t", *(f"joint {i} [deg]" for i in (5, 4, 3, 2, 1))])), None,
            "must be the joints, front to rear.*rise by 1",
        ),
        (as_csv(TIMES, ANGLES), "rad", "contradicts unit = 'rad'"),
        (as_csv(TIMES, ANGLES).replace("10.0000", "abc", 1), None, "of 6 numbers with .*: line 2, .*'abc'"),
        ("# from the lab\n\n" + as_csv(TIMES, ANGLES) + "\n1", None, "of 6 numbers .*: line 204 has 1 cells"),
        (as_csv(TIMES, ANGLES).replace("0.0500", '"0,0500"'), None, "decimal points, .*: line 3 has 7 cells"),
        (as_csv(TIMES[::-1], ANGLES), None, r"times of samples 1 and 2 = \[9.95, 9.9\]: must rise"),
        (as_csv(TIMES, ANGLES).replace("10.0000", "1e400", 1), None, r"joint .* = inf: must be finite, .*: sample 1"),
            ('name = "aoi2022"\nstride = 1\n', None, "must be a line of names"),
        ("\x89HDF and more", None, "is not a text file"),
    ],
)  # fmt: skip
def test_a_recording_that_is_none_is_refused_in_one_line(tmp_path, text, unit, said):
    (tmp_path / "walk.csv").write_bytes(text.encode("latin-1"))
    with pytest.raises(ChilopodError, match=f"walk.csv: .*{said}"):
        read_recordings(ROBOT, data("walk.csv", unit=unit), tmp_path)


def test_a_recording_does_not_count_twice(tmp_path):
    for name in ("walk.csv", "copy.csv"):
        (tmp_path / name).write_text(as_csv(TIMES, ANGLES))
    with pytest.raises(ChilopodError, match=r"trajectory.file = 'copy.csv': has the same walk as walk.csv"):
        read_recordings(ROBOT, data("walk.csv", "copy.csv"), tmp_path)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ([], r"springs.stiffness\[0\] = '41 N\*mm/deg': must be that of the recording; allowed: 9 N\*mm/deg in"),
        ([SPRING, "gait.stride=4 cm"], r"gait.stride = '4 cm': must be that of the recording; allowed: 3 cm in"),
    ],
)
def test_settings_that_contradict_the_record_of_a_simulation_are_refused(tmp_path, settings, said):
    (tmp_path / "walk.nc").write_bytes(netcdf(walked(SOFT, 9.0)))
    given = RecordedWalks(free=FREE, trajectory=[{"file": "walk.nc", "settings": settings}])
    with pytest.raises(ChilopodError, match=f"walk.nc: {said}"):
        read_recordings(ROBOT, given, tmp_path)


@pytest.mark.parametrize(
    ("path", "setting"),
    [
        ("springs.stiffness[0]", SPRING),
        ("springs.stiffness[:1]", SPRING),
        ("springs.stiffness[2]", "springs.stiffness[1:]=41 N*mm/deg"),
        ("springs.stiffness", "springs.stiffness[0:5]=41 N*mm/deg"),
    ],
)
def test_a_setting_of_a_walk_cannot_be_free(tmp_path, path, setting):
    given = data("walk.csv", free={path: (0.2, 0.8)}, settings=[setting])
    with pytest.raises(ChilopodError, match=rf"free.{re.escape(path)}.*: must not be a setting"):
        read_recordings(ROBOT, given, tmp_path)


@pytest.mark.parametrize("second", ["springs.stiffness[1:5]", "springs.stiffness[03]", "springs.stiffness"])
def test_two_ranges_of_one_number_are_refused(tmp_path, second):
    free = {"springs.stiffness[1:]": (1.0, 5.0), second: (1.0, 5.0)}
    with pytest.raises(ChilopodError, match=rf"free.{re.escape(second)}.: must not change .*springs.stiffness\[3\]"):
        read_recordings(ROBOT, data("walk.csv", free=free), tmp_path)


def test_groups_of_springs_have_their_intervals_as_provenance():
    free = FreeConstants.read({"springs.stiffness[1:]": ["20 N*mm/deg", "80 N*mm/deg"], "springs.damping": (0.0, 1.0)})
    ends = np.array([[2.2, 2.4], [0.4, 0.6]])
    found = Estimates(ROBOT, free, ends.mean(axis=1), ends, np.diag([0.1, 0.1]) ** 2).identified("mine.toml")
    told = {path: origin for path, _, origin in Robot.from_toml(found.to_toml()).listed()}
    assert told["springs.stiffness[0]"] == ROBOT.provenance_of("springs.stiffness[0]")
    for joint in range(5):
        assert told[f"springs.damping[{joint}]"] == "identified from mine.toml; 90 %: 0.4 N*m*s/rad to 0.6 N*m*s/rad"
        assert joint == 0 or told[f"springs.stiffness[{joint}]"].startswith("identified from mine.toml; 90 %: 38.")
    assert "springs.damping" not in found.provenance


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("ground.friction=60 N*s/m", "free[ground.friction]: must not be a setting of a walk too"),
        ("springs.stiffness[9]=1 N*m/rad", "trajectory.0.settings springs.stiffness[9]: must be the index of a spring"),
    ],
)
def test_a_fault_of_the_data_names_their_file(capsys, tmp_path, monkeypatch, setting, said):
    monkeypatch.chdir(tmp_path)
    walk = f'[[trajectory]]\nfile = "walk.csv"\nsettings = ["{setting}"]\n'
    (tmp_path / "mine.toml").write_text(f'[free]\n"ground.friction" = ["100 N*s/m", "500 N*s/m"]\n{walk}')
    assert main(["identify", "planar", "--data", "mine.toml"]) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith(f"error: mine.toml: {said}")


def test_the_command_writes_walks_and_a_robot_with_its_intervals(capsys, tmp_path):
    (tmp_path / "walk.nc").write_bytes(netcdf(walked(SOFT, 9.0).isel(time=slice(20, None))))
    free = '[free]\n"ground.friction" = ["100 N*s/m", "500 N*s/m"]\n'
    (tmp_path / "my\tdata.toml").write_text(f'{free}[[trajectory]]\nfile = "walk.nc"\nsettings = ["{SPRING}"]\n')
    arguments = [
        "identify",
        "planar",
        "--data",
        str(tmp_path / "my\tdata.toml"),
        "--out",
        str(tmp_path / "out"),
        "--json",
    ]
    for option in (["--next"], ["--check", "2"], ["--points", "5"]):
        assert main([*arguments, *option]) == 2
        assert capsys.readouterr().err.startswith(f"error: {option[0]}: must not be given with recorded walks")
    assert main(arguments) == 0
    found = json.loads(capsys.readouterr().out)
    best = load_robot(tmp_path / "out" / "identified.toml")
    assert best.get("ground.friction") == pytest.approx(246.5, rel=1e-4)
    interval = found["constants"]["ground.friction"]["interval_text"]
    assert best.provenance["ground.friction"] == f"identified from my\\tdata.toml; 90 %: {interval}"
    assert (tmp_path / "out" / "identification.nc").exists()


def test_a_straight_walk_leaves_all_constants_open(tmp_path):
    # Its joint angles are zero whatever the constants are: those that the file holds are no better than others.
    record = simulate(ROBOT, 6.0, rate=20.0)
    assert not record.joint_angle.values.any()
    (tmp_path / "walk.nc").write_bytes(netcdf(record))
    free = {path: FREE[path] for path in ("ground.friction", "legs.half_width")}
    given = RecordedWalks(free=free, trajectory=[{"file": "walk.nc"}])
    found = identify_recorded(ROBOT, given, tmp_path)
    for path, each in found.as_json()["constants"].items():
        assert each["interval_si"] == pytest.approx(FREE[path])


def test_a_search_that_creeps_along_what_the_data_do_not_set_has_converged(tmp_path):
    record, rng = walked(SOFT, 8.0), np.random.default_rng(5)
    angles = np.rad2deg(record.joint_angle.values[:, 0]) + rng.normal(0.0, 0.3, (record.time.size, 5))
    (tmp_path / "walk.csv").write_text(as_csv(record.time.values, angles))
    own = data("walk.csv")
    walks = trajectories._Walks(ROBOT, own.free, read_recordings(ROBOT, own, tmp_path))
    start = np.concatenate([walks.given, [0.0], START[0, 3:8] if START.ndim > 1 else START[3:8]])
    cost, best = walks.fit(start, 1e-9, 20)
    # The combination of phase and angles at the start that the walk hardly shows, off by half a standard deviation.
    _, sizes, ways = np.linalg.svd(walks.jacobian(best)[:, 3:])
    off = np.concatenate([np.zeros(3), 0.5 * np.sqrt(2.0 * cost / angles.size) / sizes[-1] * ways[-1]])
    for free, converged in ((start + 0.1, False), (best + off, True)):
        walks.fit(free, 1e-15, 1)  # ends at once
        assert walks.converged is converged
