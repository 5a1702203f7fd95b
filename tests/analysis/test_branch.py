"""Curved walks of the preset: the branch beyond the pitchfork, against long simulations and known symmetries."""

import os

import numpy as np
import pytest
import xarray as xr

from chilopod import stability
from chilopod.analysis.branch import as_json, curved_walks, read_walks, resumed
from chilopod.analysis.parameters import K1, stiffness
from chilopod.errors import AnalysisError, ParameterError
from chilopod.netcdf import netcdf, sealed
from chilopod.planar import PlanarModel
from chilopod.planar.along import walk_means
from chilopod.robot import load_robot
from chilopod.show import write_branch
from chilopod.show.figures.branch import panel
from chilopod.stability import Ending
from chilopod.stability.branches.branch_points import BranchPoint
from chilopod.stability.branches.curve import Curve
from chilopod.stability.returns import whole_period
from chilopod.steering.radius_law import RadiusLaw

ROBOT = load_robot("aoi2022-planar")


@pytest.fixture(scope="module")
def right():
    return curved_walks(ROBOT, K1, (stiffness(7.8), stiffness(20.0)), points=40)


def radius_at(robot, data, k1):
    """Of the body axis on the orbit at a spring, found from the nearest point of the branch."""
    near = data.isel(point=int(np.abs(data.parameter.values - k1).argmin()))
    model = PlanarModel(robot.with_value(K1, stiffness(k1)), tolerance=1e-11)
    orbit = stability.find_orbit(whole_period(model), near.orbit.values, with_error=False).state
    angles = walk_means([model], orbit[None]).mean_angle[0]
    return 5 * robot.module_length / np.abs(angles).sum()


def test_the_radius_of_the_body_axis(former):
    """Long simulations of an independent program: r = 1.095, 0.680, 0.544, 0.425, 0.318 m at these springs."""
    branch = curved_walks(former, K1, (stiffness(7.8), stiffness(20.0)), points=40)
    found = [radius_at(former, branch, k1) for k1 in (11.9, 11.5, 11.0, 10.0, 8.0)]
    assert found == pytest.approx([1.095, 0.680, 0.544, 0.425, 0.318], rel=0.005)


def test_walks_beside_the_pitchfork_are_as_stable_as_those_beyond():
    """Their multipliers are too near the circle to decide alone, for which the radius law was refused."""
    robot = ROBOT.set_from_text(["springs.stiffness=10 N*mm/deg"])
    walks = curved_walks(robot, K1, (stiffness(2.0), stiffness(10.0)), points=6)
    assert 1.0 - walks.multiplier.values[1] < 1e-6
    assert walks.verdict.values.tolist() == ["undecided", *["stable"] * 6]
    assert RadiusLaw.of_branch(walks.parameter_si, walks.axis_radius, walks.stable, "N*mm/deg").tightest < 10.0


@pytest.mark.parametrize(("mass", "length"), [(1e-4, 3e-3), (1e3, 10.0)])
def test_a_robot_of_another_size_has_the_same_branch(mass, length):
    """Its fold and its verdicts too: errors are relative to the sizes of its own motion."""

    def branch(mass, length):
        robot, unit = ROBOT.with_value("legs.forward_offset", 0.02), mass * length**2
        lengths = "body.length", "legs.forward_offset", "legs.half_width", "gait.stride"
        for path in lengths:
            robot = robot.with_value(path, robot.get(path) * length)
        for path in ("body.mass", "ground.friction"):
            robot = robot.with_value(path, robot.get(path) * mass)
        for joint in range(5):
            path = f"springs.stiffness[{joint}]"
            robot = robot.with_value(path, robot.get(path) * unit)
        return curved_walks(robot, K1, (stiffness(9.0) * unit, stiffness(20.0) * unit), points=12)

    here, there = branch(1.0, 1.0), branch(mass, length)
    assert "fold" in here.special.values
    for name in ("special", "verdict"):
        np.testing.assert_array_equal(there[name].values, here[name].values)
    np.testing.assert_allclose(there.multiplier, here.multiplier, rtol=0, atol=1e-9)


def test_the_branch_is_stable_and_turns_right(right):
    assert right.stable.values[1:].all()
    assert right.special.values[0] == "pitchfork"
    assert (right.mean_angle.values[1:] > 0).all()
    assert (right.heading_rate.values[1:] < 0).all()


def test_powers_balance_over_a_period(right):
    assert right.leg_power.values == pytest.approx(-right.floor_power.values, rel=1e-5, abs=1e-9)


def test_left_is_the_mirror_image_of_right_half_a_period_later():
    left = curved_walks(ROBOT, K1, (stiffness(7.8), stiffness(20.0)), points=5, side=-1)
    point = left.isel(point=-1)
    model = PlanarModel(ROBOT.with_value(K1, stiffness(float(point.parameter))), tolerance=1e-11)
    half_way = model.flow_states(point.orbit.values[None], 0.0, model.period / 2)[0]
    mirrored = model.reflection @ half_way
    assert model.flow_states(mirrored[None], 0.0, model.period)[0] == pytest.approx(mirrored, abs=1e-9)
    there, here = model.drift(mirrored), model.drift(point.orbit.values)
    assert there.turn == pytest.approx(-here.turn, rel=1e-7)
    # Module 1 sways: its places at phase 0 and half a period later lie on circles that differ a little.
    assert there.radius == pytest.approx(here.radius, rel=1e-4)
    assert (point.mean_angle.values < 0).all()
    assert here.turn > 0


def test_a_disturbed_walk_settles_on_the_branch(right):
    point = right.isel(point=12)
    model = PlanarModel(ROBOT.with_value(K1, stiffness(float(point.parameter))), tolerance=1e-10)
    state = point.orbit.values + np.r_[np.zeros(3), 0.02 * np.ones(5), np.zeros(5)]
    for _ in range(1000):
        state = model.flow_states(state[None], 0.0, model.period)[0]
    assert state == pytest.approx(point.orbit.values, abs=1e-6)


def test_near_zero_forward_offset_the_branch_folds_back(former):
    robot = former.with_value("legs.forward_offset", 0.02)
    data = curved_walks(robot, K1, (stiffness(9.0), stiffness(20.0)), points=20)
    special = list(data.special.values)
    fold = special.index("fold")
    assert float(data.parameter[fold]) == pytest.approx(10.3881, abs=1e-4)
    assert abs(float(data.tangent[fold, -1])) < 1e-6
    assert data.attrs["criticality"] == data.attrs["direction"] == "subcritical"
    assert data.attrs["direction_confirms"] == "yes"
    assert float(data.parameter[fold]) > float(data.parameter[0])
    assert not data.stable.values[1:fold].any()
    assert data.stable.values[fold + 1 :].all()


def test_nothing_happens_on_the_way_to_very_soft_springs():
    data = curved_walks(ROBOT, K1, (stiffness(1.0), stiffness(20.0)))
    within = data.verdict.values != "out of range"
    assert data.attrs["ending"] == "left the interval"
    assert list(data.special.values[1:]) == [""] * (data.sizes["point"] - 1)
    assert data.stable.values[1:][within[1:]].all()
    moduli = np.hypot(data.multiplier_real.values, data.multiplier_imag.values)
    assert (moduli[1:] < 1.0).all()


def test_the_direction_confirms_the_verdict(right):
    assert right.attrs["criticality"] == right.attrs["direction"] == "supercritical"
    assert right.attrs["direction_confirms"] == "yes"


def test_orbits_and_multipliers_are_as_good_as_is_said(right):
    curve = Curve(lambda value: PlanarModel(ROBOT.with_value(K1, value), tolerance=1e-14), right.attrs["scale"])
    curve.sizes = np.ones(right.isel(point=0).orbit.size)
    for index in (3, 8, 12, -1):
        at = right.isel(point=index)
        multipliers = at.multiplier_real.values + 1j * at.multiplier_imag.values
        units = curve.units
        point = BranchPoint(float(at.parameter_si), at.orbit.values, multipliers, at.tangent.values, units)
        image = curve.image(point.orbit, point.value)
        # How far the point is off the curve, at right angles to it.
        off = np.linalg.solve(curve.anchor(point).matrix, np.append(image.state - point.orbit, 0.0))
        assert np.abs(off).max() < 1e-9
        expected = np.linalg.eigvals(image.jacobian)
        assert np.abs(expected[:, None] - multipliers).min(axis=0).max() < 1e-8


def test_in_pieces_from_files_as_in_one(tmp_path):
    between = (stiffness(7.8), stiffness(20.0))
    whole = curved_walks(ROBOT, K1, between, points=9)
    write_branch(curved_walks(ROBOT, K1, between, points=5), tmp_path)
    pieces = resumed(read_walks(tmp_path / "branch.nc"), ROBOT, K1, points=4)
    xr.testing.assert_equal(pieces, whole)
    assert pieces.attrs == whole.attrs


def test_only_its_own_branch_is_resumed(tmp_path):
    between = (stiffness(7.8), stiffness(20.0))
    data = curved_walks(ROBOT, K1, between, points=2)
    # What the robot has for the parameter does not matter, nor what it is called.
    same = ROBOT.with_value(K1, 0.1).with_(name="renamed")
    assert resumed(data, same, K1, points=1).sizes["point"] == data.sizes["point"] + 1
    for robot, parameter, side, match in (
        (ROBOT.with_value("ground.friction", 200.0), K1, None, "another robot: ground"),
        (ROBOT, "springs.stiffness[1]", None, "saved branch varies"),
        (ROBOT, K1, -1, "the side to which"),
    ):
        with pytest.raises(ParameterError, match=match):
            resumed(data, robot, parameter, side=side)


def test_a_branch_that_left_its_interval_goes_on_beyond_it():
    data = curved_walks(ROBOT, K1, (stiffness(7.8), stiffness(20.0)), points=1)
    end = float(data.parameter_si[-1])
    data.attrs |= {"lowest_si": end, "ending": Ending.LEFT_INTERVAL.label}
    for between, said in ((None, "between: "), ((end, stiffness(20.0)), r"between = .*: ")):
        with pytest.raises(ParameterError, match=f"^{said}must go on beyond .* allowed: a wider interval$"):
            resumed(data, ROBOT, K1, between)
    assert resumed(data, ROBOT, K1, (stiffness(7.8), end), points=1).sizes["point"] == data.sizes["point"] + 1


def test_a_damaged_or_edited_file_is_refused(tmp_path):
    data = curved_walks(ROBOT, K1, (stiffness(7.8), stiffness(20.0)), points=2)
    write_branch(data, tmp_path)
    path = tmp_path / "branch.nc"
    whole = path.read_bytes()
    rng = np.random.default_rng(1)
    damaged = [whole[:length] for length in (0, 10, 4096, len(whole) - 1)]
    for place, flip in zip(rng.integers(len(whole), size=100), rng.integers(1, 256, size=100), strict=True):
        damaged.append(whole[:place] + bytes([whole[place] ^ flip]) + whole[place + 1 :])
    data.to_netcdf(tmp_path / "edited.nc", engine="h5netcdf")
    for content in [*damaged, (tmp_path / "edited.nc").read_bytes()]:
        path.write_bytes(content)
        with pytest.raises(ParameterError, match="is damaged or was edited"):
            read_walks(path)
    path.write_bytes(sealed(netcdf(data.assign_attrs(version=0))))
    with pytest.raises(ParameterError, match="of this version of chilopod"):
        read_walks(path)
    path.unlink()
    with pytest.raises(ParameterError, match="does not exist"):
        read_walks(path)
    os.mkfifo(path)
    with pytest.raises(ParameterError, match="cannot be read"):
        read_walks(path)


def test_joints_beyond_their_range_are_no_stable_walk():
    """The engines end a walk there, and so do the law and the live page."""
    branch = curved_walks(ROBOT, K1, (stiffness(0.35), stiffness(20.0)), points=60)
    beyond = branch.most_bent.values > 0.5 * np.pi
    assert 0 < beyond.sum() < beyond.size
    assert ((branch.verdict.values == "out of range") == beyond).all()
    assert not (branch.stable.values & beyond).any()
    assert (branch.most_bent.values >= np.abs(branch.mean_angle.values).max(axis=1)).all()
    points = as_json(branch)["points"]
    assert {point["stable"] for point in points if point["verdict"] == "out of range"} == {None}
    assert {point["verdict"] for point in points if point["stable"]} == {"stable"}


@pytest.mark.parametrize("joints", [5, 9, 40])
def test_the_figure_shows_every_joint(right, joints):
    angles = np.repeat(right.mean_angle.values, 8, axis=1)[:, :joints]
    data = (
        right.drop_dims("joint")
        .assign(mean_angle=(("point", "joint"), angles))
        .assign_coords(joint=range(1, joints + 1))
    )
    drawn = panel(data).draw(False).axes[0]
    names = drawn.get_legend_handles_labels()[1]
    assert [name for name in names if name.startswith("joint")] == [f"joint {joint}" for joint in data.joint.values]
    assert len({str(line.get_color()) for line in drawn.lines if line.get_label().startswith("joint")}) == joints


def test_no_pitchfork_is_said():
    with pytest.raises(AnalysisError, match="no pitchfork"):
        curved_walks(ROBOT, K1, (stiffness(20.0), stiffness(30.0)))


def test_why_a_gait_without_mirror_symmetry_has_no_pitchfork_is_said():
    uneven = ROBOT.with_value("gait.side_phase", np.deg2rad(170.0))
    with pytest.raises(
        AnalysisError, match=r"transcritical, and no pair .* side_phase is not 180 deg; allowed: .* at 11\.93"
    ):
        curved_walks(uneven, K1, (stiffness(11.0), stiffness(13.0)))


def test_written_and_printed(right, tmp_path):
    files = write_branch(right, tmp_path)
    assert all(file.stat().st_size > 0 for file in files)
    result = as_json(right)
    assert result["points"][0]["axis_radius_m"] is None
    assert result["points"][0]["special"] == "pitchfork"
    assert len(result["points"][3]["mean_joint_angles_rad"]) == 5
    assert len(result["points"][3]["multipliers"]) == 13
    assert result["direction_confirms"] is True
    lines = (tmp_path / "branch.csv").read_text().splitlines()
    assert len([line for line in lines if not line.startswith("#")]) == 1 + right.sizes["point"]


def test_a_search_for_the_pitchfork_that_takes_too_long_is_given_up():
    """Not "no pitchfork": none was looked for."""
    with pytest.raises(AnalysisError, match=r"8 N.*20 N.*: the search for a pitchfork was given up after 0 s; allowed"):
        curved_walks(ROBOT, K1, (stiffness(8.0), stiffness(20.0)), seconds=0.0)
