"""The page puts the robot where the simulation had it, needs nothing else, and is small."""

import base64
import json
import re
import shutil
import subprocess
from importlib.resources import files

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from chilopod import load_robot
from chilopod.errors import ParameterError
from chilopod.show import replay
from chilopod.steering import LegYawController
from chilopod.twin import initial_states, simulate
from chilopod.twin.model import compiled
from helpers.html_page import Page

ROBOT = load_robot("aoi2022")
EVERY = 4  # samples at 100 Hz from frame to frame


@pytest.fixture(scope="module")
def record():
    """Two robots that turn, one of them across the heading at which a quaternion changes sign; a third that stops."""
    bent = initial_states(ROBOT, [0.3, 0.2, 0.1, -0.1, -0.2], heading=[0.4, 3.1, -1.0], position=[0.2, -0.1])
    targets = [[1.0, 0.8], [-1.0, 0.3], [0.2, -1.2]]
    data = simulate(ROBOT, 2.0, initial=bent, controller=LegYawController(), target=targets, poses=True)
    data["pose"][:, 1, 3:7] *= np.where(np.arange(len(data.time)) % 8 < 4, 1.0, -1.0)[:, None]
    data["status"][2] = "fallen"
    for name in ("position", "heading", "joint_angle", "leg_yaw", "pose", "distance"):
        data[name][data.time.values > 1.0, 2] = np.nan
    return data


@pytest.fixture(scope="module")
def html(record) -> str:
    return replay(record, titles=["a <b>", "k₁", "c"], heading="Three </script> walks").html


@pytest.fixture(scope="module")
def data(html) -> dict:
    return json.loads(Page(html).data)


def coordinates(data: dict, robot: int) -> np.ndarray:
    """As the script reads them, (T, coordinates)."""
    raw = np.frombuffer(base64.b64decode(data["robots"][robot]["pose"]), "<i2").reshape(data["time"]["count"], -1)
    return np.where(raw == -32768, np.nan, data["scale"]["origin"] + raw * np.array(data["scale"]["step"]))


def rotation(quaternion) -> Rotation:
    return Rotation.from_quat(np.roll(quaternion, -1))


def placed(data: dict, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (S, 3) and rotation matrices (S, 3, 3) of all shapes, from what the page says of the bodies."""
    bodies: list[tuple[np.ndarray, Rotation]] = []
    for body in data["bodies"]:
        parent, facing = bodies[body["parent"]] if bodies else (np.zeros(3), Rotation.identity())
        place, turn = parent + facing.apply(body["place"]), facing * rotation(body["turn"])
        for joint in body["joints"]:
            at, anchor = joint["at"], np.array(joint["anchor"])
            if joint["free"]:
                place, turn = values[at : at + 3], rotation(values[at + 3 : at + 7])
            else:
                fixed = place + turn.apply(anchor)
                turn = turn * Rotation.from_rotvec(values[at] * np.array(joint["axis"]))
                place = fixed - turn.apply(anchor)
        bodies.append((place, turn))
    shapes = [(*bodies[shape["body"]], shape["place"], rotation(shape["turn"])) for shape in data["shapes"]]
    return (
        np.array([place + turn.apply(there) for place, turn, there, _ in shapes]),
        np.array([(turn * there).as_matrix() for _, turn, _, there in shapes]),
    )


def simulated(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same by MuJoCo, of its geometry without floor and pole."""
    model = compiled(ROBOT).model
    state = mujoco.MjData(model)
    state.qpos[:] = pose
    mujoco.mj_kinematics(model, state)
    shown = [i for i in range(model.ngeom) if model.geom(i).name not in ("floor", "pole")]
    return state.geom_xpos[shown], state.geom_xmat[shown].reshape(-1, 3, 3)


def test_script_uses_what_the_page_has(html):
    page = Page(html)
    identifiers = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(set(identifiers)) == len(identifiers)
    assert set(re.findall(r"byId\(\"([\w-]+)\"\)", html)) <= set(identifiers)
    assert len(page.all("canvas")) == 3
    assert "WebGL" in html
    assert "Three &lt;/script&gt; walks" in html


def test_coordinates_are_the_simulated_ones(record, data):
    expected = record.pose.values[::EVERY]
    rounding = 0.501 * np.array(data["scale"]["step"])
    assert rounding[:3].max() < 2e-4  # m
    assert rounding[3:].max() < 2e-5  # rad
    for robot in range(2):
        found = coordinates(data, robot)
        sign = np.where((found[:, 3:7] * expected[:, robot, 3:7]).sum(axis=1) < 0.0, -1.0, 1.0)
        signs = np.ones_like(found)
        signs[:, 3:7] = sign[:, None]
        assert (np.abs(found * signs - expected[:, robot]) <= rounding).all()
        # Between frames the page interpolates.
        assert np.abs(np.diff(found[:, 3:7], axis=0)).max() < 0.05


def test_shapes_are_where_the_simulation_has_them(record, data):
    model = compiled(ROBOT).model
    assert [shape["role"] for shape in data["shapes"]].count("foot") == 12
    assert [shape["role"] for shape in data["shapes"]].count("front") == 1
    for robot, frame in ((0, 0), (0, 37), (1, 50)):
        places, turns = placed(data, coordinates(data, robot)[frame])
        expected_places, expected_turns = simulated(record.pose.values[EVERY * frame, robot])
        count = len(expected_places)
        assert count == model.ngeom - 2 == len(places) - 5
        np.testing.assert_allclose(places[:count], expected_places, atol=4e-4)
        np.testing.assert_allclose(turns[:count], expected_turns, atol=2e-4)
        # Yaw joints are halfway between the modules that they join, to first order of the bend.
        boxes = places[[i for i, shape in enumerate(data["shapes"]) if shape["kind"] == "box"]]
        np.testing.assert_allclose(places[count:], 0.5 * (boxes[1:] + boxes[:-1]), atol=0.02)


@pytest.mark.skipif(shutil.which("node") is None, reason="node runs the page's script outside of a browser")
def test_script_places_shapes_likewise(data, tmp_path):
    script = files("chilopod.show.scene").joinpath("replay_3d_pose.js").read_text(encoding="utf-8")
    test = """
    const data = JSON.parse(require("fs").readFileSync(0));
    const poses = replayPoses(data);
    const found = data.robots.slice(0, 2).map((robot) => {
      const raw = new Int16Array(Uint8Array.from(atob(robot.pose), (letter) => letter.charCodeAt(0)).buffer);
      return [0.28, 1.22].map((now) => poses.at(raw, now).map((matrix) => [...matrix]));
    });
    console.log(JSON.stringify(found));
    """
    path = tmp_path / "test.cjs"
    path.write_text(script + test, encoding="utf-8")
    done = subprocess.run(
        ["node", str(path)], input=json.dumps(data), capture_output=True, text=True, check=True, timeout=60
    )
    found = np.array(json.loads(done.stdout)).reshape(2, 2, -1, 4, 4)
    for robot in range(2):
        values = coordinates(data, robot)
        # The second time is halfway between two frames.
        for place, wanted in enumerate((values[7], 0.5 * (values[30] + values[31]))):
            places, turns = placed(data, wanted)
            np.testing.assert_allclose(found[robot, place, :, 3, :3], places, atol=1e-6)
            np.testing.assert_allclose(found[robot, place, :, :3, :3].swapaxes(1, 2), turns, atol=1e-6)


def test_robots_stay_where_they_stopped(record, data):
    found = coordinates(data, 2)
    assert data["robots"][2]["outcome"]["kind"] == "stopped"
    np.testing.assert_array_equal(found[26:], np.tile(found[25], (len(found) - 26, 1)))
    np.testing.assert_allclose(found[25, :2], record.pose.values[100, 2, :2], atol=2e-4)
    assert [aim["place"] for aim in data["robots"][1]["aims"]] == [[-1.0, 0.3]]
    assert data["arrivalRadius"] == 0.15


def test_robots_that_never_started_or_blew_up(record):
    wild = record.copy(deep=True)
    for name in ("position", "heading", "joint_angle", "leg_yaw", "pose"):
        wild[name][:, 2] = np.nan
    wild["pose"][40:, 1] = 1e300
    found = json.loads(Page(replay(wild, titles="abc", heading="h").html).data)
    assert np.isnan(coordinates(found, 2)).all()
    assert np.abs(coordinates(found, 1)).max() < 30.0


def test_page_is_small():
    data = simulate([ROBOT] * 3, 1.0, poses=True)
    data = data.isel(time=np.tile(np.arange(100), 23)).assign_coords(time=0.01 * np.arange(2300))
    assert len(replay(data, titles="abc", heading="h").html.encode()) < 300_000


def test_wrong_records(record):
    with pytest.raises(ParameterError, match="allowed: 38") as caught:
        replay(record.isel(coordinate=slice(30)), titles="abc", heading="h")
    assert "\n" not in str(caught.value)
    with pytest.raises(ParameterError, match="titles"):
        replay(record, titles="a", heading="h")
    planar = record.copy()
    planar.attrs["robot"] = load_robot("aoi2022-planar").to_toml()
    with pytest.raises(ParameterError, match="twin"):
        replay(planar, titles="abc", heading="h")
