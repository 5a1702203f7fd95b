"""Pictures of the twin show the robot where the record has it, and films and stills are as large as asked for."""

import io

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from chilopod import load_robot
from chilopod.errors import OutputError, ParameterError
from chilopod.show import style
from chilopod.show.scene.film_3d import Film3D, stills
from chilopod.show.scene.stage_3d import Look, Studio, framing
from chilopod.twin import gl, initial_states, simulate
from helpers.films import decoded

ROBOT = load_robot("aoi2022")
N = ROBOT.body.modules


def read(picture):
    return imread(io.BytesIO(picture))


@pytest.fixture(scope="module")
def drawn():
    if gl.find().backend is None:
        pytest.skip(gl.find().missing)


@pytest.fixture(scope="module")
def record():
    return simulate([ROBOT, ROBOT.with_value("springs.stiffness[0]", 1.0)], 1.0, rate=25.0, poses=True)


def near(pixels, color, far=60.0):
    """Where something of nearly this colour is, (height, width)."""
    return np.abs(pixels[..., :3].astype(float) - 255.0 * np.array(to_rgb(color))).max(axis=-1) < far


def look(pose, **more):
    stands = np.ones((N, 2), bool)
    rest = {
        "springs": np.ones(N - 1), "walks": True, "path": np.zeros((0, 2)), "target": None, "radius": 0.15,
        "arrived": False,
    }  # fmt: skip
    return Look(pose=pose, stands=stands, **{**rest, **more})


@pytest.fixture
def studio(drawn):
    view = framing([[-1.5, -0.5, 0.0], [0.5, 0.5, 0.3]], 4.0 / 3.0)
    with gl.context(200, 150):
        made = Studio(ROBOT, (200, 150), view)
        yield lambda shown: made.picture(shown, view).copy()
        made.close()


def place_of(mask):
    """Row and column of the middle, pixels."""
    assert mask.sum() > 10
    return np.argwhere(mask).mean(axis=0)


@pytest.mark.parametrize("aspect", [0.5, 1.0, 3.0])
def test_framing_holds_all_points_and_not_much_more(aspect):
    points = np.random.default_rng(3).uniform([-2.0, 0.0, 0.0], [1.0, 5.0, 0.4], (50, 3))
    view = framing(points, aspect)
    tilt = np.radians(40.0)
    ahead = np.array([0.0, np.cos(tilt), -np.sin(tilt)])
    seen = points - (view.middle - view.distance * ahead)
    half = np.tan(np.radians(15.0))
    across = seen[:, 0] / (seen @ ahead) / (half * aspect)
    up = seen @ np.array([0.0, np.sin(tilt), np.cos(tilt)]) / (seen @ ahead) / half
    assert max(np.abs(across).max(), np.abs(up).max()) == pytest.approx(1.0)
    assert across.max() == pytest.approx(-across.min(), abs=0.3)


def test_the_robot_is_where_its_pose_is(studio):
    straight, bent = initial_states(ROBOT), initial_states(ROBOT, np.full(N - 1, 0.3))
    forward = initial_states(ROBOT, position=(0.3, 0.0))
    left = initial_states(ROBOT, position=(0.0, 0.3))
    front = [place_of(near(studio(look(pose[0])), style.BLUE)) for pose in (straight, forward, left)]
    assert front[1][1] > front[0][1] + 10.0  # x is to the right
    assert front[2][0] < front[0][0] - 10.0  # y is up
    # Joint angles are those of a module less that in front: the tail of a left bend hangs to the right of the heading.
    rear = [np.argwhere(near(studio(look(pose[0])), style.SKY)) for pose in (straight, bent)]
    assert np.ptp(rear[1][:, 0]) > np.ptp(rear[0][:, 0]) + 10.0


def test_floor_target_path_and_robots_that_stopped(studio):
    pose = initial_states(ROBOT)[0]
    floor = studio(look(None))
    assert not near(floor, style.BLUE).any()
    assert np.ptp(floor.astype(int), axis=-1).max() < 20  # nothing but greys
    assert len(np.unique(floor[..., 0])) > 3  # tiles
    target = studio(look(None, target=np.array([0.0, 0.0])))
    arrived = studio(look(None, target=np.array([0.0, 0.0]), arrived=True))
    assert near(arrived, style.GREEN, 50.0).sum() > near(target, style.GREEN, 50.0).sum()
    path = np.column_stack([np.linspace(-1.0, 0.4, 50), np.full(50, -0.3)])
    assert near(studio(look(None, path=path)), style.ORANGE).sum() > 50
    assert near(studio(look(pose)), style.BLUE).sum() > 50
    assert near(studio(look(pose, walks=False)), style.BLUE).sum() == 0  # pale
    with pytest.raises(ParameterError, match="pose"):
        studio(look(pose[:-1]))


@pytest.mark.parametrize("follow", [False, True])
def test_film(drawn, record, follow):
    film = Film3D(record, titles=["a", "b"], heading="h", fps=5, size=(480, 240), follow=follow).mp4()
    frames = decoded(film, rate=5)
    assert frames.shape == (6, 240, 480, 3)
    blue = near(frames[0][30:-40], style.BLUE)
    assert blue[:, :240].any()  # a robot in each panel
    assert blue[:, 240:].any()


def test_film_of_robots_that_stop_or_never_start(drawn, record):
    stopped = record.copy(deep=True)
    for name in ("pose", "position", "heading", "joint_angle", "leg_yaw"):
        stopped[name][10:, 0] = np.nan
        stopped[name][:, 1] = np.nan
    stopped["status"] = ("robot", np.array(["fallen", "diverged"], dtype=object))
    film = Film3D(stopped, titles=["x" * 200, "b"], heading="y" * 200, fps=2, size=(320, 240)).mp4()
    assert len(film) > 1000


def test_the_poster_is_as_large_as_the_film(drawn, record):
    picture = read(Film3D(record, titles=["a", "b"], heading="h", size=(480, 240)).poster())
    assert picture.shape == (240, 480, 4)
    assert near(255.0 * picture, style.BLUE).any()


def test_stills(drawn, record):
    picture = read(stills(record, [0.0, 0.5, 1.0], titles=["a", "b"]))
    one = read(stills(record.isel(robot=[0]), [0.0, 1.0], titles=["a"]))
    assert picture.shape[1] > 3 * 640
    assert picture.shape[0] > 2 * 400
    assert one.shape[1] < 3 * 640
    assert near(255.0 * one, style.BLUE)[:, :652].any()
    assert near(255.0 * one, style.BLUE)[:, 652:].any()


def test_what_cannot_be_drawn(monkeypatch, record):
    names = {"titles": ["a", "b"], "heading": "h"}
    for wrong in ({"size": (481, 320)}, {"size": (480, 100)}, {"fps": 0}, {"speed": 0.0}, {"titles": ["a"]}):
        with pytest.raises(ParameterError, match=next(iter(wrong))):
            Film3D(record, **{**names, **wrong}).mp4()
    with pytest.raises(ParameterError, match="poses"):
        Film3D(record.drop_vars("pose"), **names).mp4()
    for times in ([], [-1.0], [2.0], [float("nan")], [0.5] * 40):
        with pytest.raises(ParameterError, match="times"):
            stills(record, times, titles=["a", "b"])
    monkeypatch.setattr(gl, "find", lambda: gl.Found(None, missing="no OpenGL works", mend="plug one in"))
    with pytest.raises(OutputError, match="no OpenGL works; to mend it: plug one in"):
        Film3D(record, **names).mp4()
    with pytest.raises(OutputError, match="plug one in"):
        stills(record, [0.0], titles=["a", "b"])
    monkeypatch.setattr("chilopod.show.scene.film.has_encoder", lambda: False)
    with pytest.raises(OutputError, match="encoder"):
        Film3D(record, **names).mp4()
