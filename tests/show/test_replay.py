"""The page holds the whole walk, needs nothing else, and is small."""

import base64
import json
import re

import numpy as np
import pytest

from chilopod.errors import OutputError
from chilopod.show import replay
from chilopod.show.scene.frames import body_frames
from helpers.html_page import Page
from helpers.walks import walk


def unpacked(data: dict, robot: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (T, P, 2) in m and whether feet stand (T, 2N), as the script reads them."""
    count, n, scale = data["time"]["count"], data["body"]["modules"], data["scale"]
    raw = np.frombuffer(base64.b64decode(data["robots"][robot]["points"]), "<i2").reshape(count, 3 * n + 1, 2)
    points = np.where(raw == -32768, np.nan, [scale["x"], scale["y"]] + raw * scale["step"])
    flags = np.frombuffer(base64.b64decode(data["robots"][robot]["stands"]), np.uint8).reshape(count, -1)
    return points, np.unpackbits(flags, axis=-1, count=2 * n, bitorder="little").astype(bool)


@pytest.fixture(scope="module")
def record():
    return walk(
        0.0, 0.6, -0.6, 0.3, stops=[(1, 2.0), (3, 0.0)], targets=[[0.5, 0.0], [2.0, 1.0], [9.0, 9.0], [1.0, 0.0]]
    )


@pytest.fixture(scope="module")
def html(record) -> str:
    return replay(record, titles=["a <b> & c", "soft", "k₁", "d"], heading="Four </script> walks").html


@pytest.fixture(scope="module")
def data(html) -> dict:
    return json.loads(Page(html).data)


def test_page_is_accessible(html):
    page = Page(html)
    assert page.all("html") == [{"lang": "en"}]
    assert len(page.all("h1")) == 1
    canvases = page.all("canvas")
    assert len(canvases) == 4
    assert all(attrs["role"] == "img" and len(attrs["aria-label"]) > 40 for attrs in canvases)
    assert canvases[0]["aria-label"].startswith("a <b> & c: ")
    assert "arrived at 3.6 s" in canvases[0]["aria-label"]
    assert [attrs["aria-label"] for attrs in page.all("input") if attrs["type"] == "range"] == ["Time"]
    assert [attrs["value"] for attrs in page.all("option")] == ["0.5", "1", "2", "4", "8"]
    identifiers = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(set(identifiers)) == len(identifiers)


def test_script_uses_what_the_page_has(html):
    identifiers = {attrs["id"] for _, attrs in Page(html).tags if "id" in attrs}
    assert set(re.findall(r"byId\(\"(\w+)\"\)", html)) <= identifiers
    assert "Four &lt;/script&gt; walks" in html


def test_points_are_those_of_the_frames(record, data):
    frames = body_frames(record, record.time.values[::2])
    assert data["time"] == {"start": 0.0, "step": pytest.approx(0.04), "count": len(frames.time)}
    rounding = 0.501 * data["scale"]["step"]
    assert rounding < 3e-4  # m, on a floor of 12 m
    for robot in range(4):
        points, stands = unpacked(data, robot)
        np.testing.assert_allclose(points[:, :7], frames.spine[:, robot], atol=rounding)
        np.testing.assert_allclose(points[:, 7:], frames.feet[:, robot].reshape(-1, 12, 2), atol=rounding)
        np.testing.assert_array_equal(stands, frames.stands[:, robot].reshape(-1, 12))
    assert np.isnan(unpacked(data, 3)[0]).all()


def test_outcomes_and_targets(data, record):
    kinds = [robot["outcome"]["kind"] for robot in data["robots"]]
    assert kinds == ["arrived", "stopped", "ended", "stopped"]
    assert [aim["place"] for robot in data["robots"] for aim in robot["aims"]] == record.target.values.tolist()
    assert data["arrivalRadius"] == 0.15
    straight = replay(walk(0.0), titles=["a"], heading="h").html
    assert "reached within" not in straight
    assert json.loads(Page(straight).data)["robots"][0]["aims"] == []


def test_positions_beyond_all_bounds(record):
    wild = record.copy(deep=True)
    wild["position"][90:99, 1] = 1e300
    points, _ = unpacked(json.loads(Page(replay(wild, titles="abcd", heading="h").html).data), 1)
    assert np.isfinite(points).all()
    assert np.abs(points).max() < 100.0


def test_page_is_small():
    html = replay(walk(0.0, 0.5, -0.5, duration=25.0, step=0.01), titles="abc", heading="h").html
    assert len(html.encode()) < 300_000


def test_notebook_plays_the_page():
    shown = replay(walk(0.0, 0.6, duration=1.0), titles=['a "<b>"', "c"], heading='"Two" & <more>')
    ((tag, frame),) = Page(shown._repr_html_()).tags
    assert tag == "iframe"
    assert frame["srcdoc"] == shown.html
    assert frame["title"] == '"Two" & <more>'
    assert frame["sandbox"] == "allow-scripts"


def test_untitled_walks_are_numbered_and_few():
    shown = replay(walk(*[0.1] * 8, duration=1.0))
    assert shown.heading == "aoi2022-planar"
    assert "walk 6" in shown.html
    assert "walk 7" not in shown.html


def test_written_page_is_not_replaced_unasked(tmp_path):
    shown = replay(walk(0.0, duration=1.0))
    shown.write(tmp_path / "walk.html")
    assert (tmp_path / "walk.html").read_text(encoding="utf-8") == shown.html
    with pytest.raises(OutputError):
        shown.write(tmp_path / "walk.html")


def test_springs_are_as_the_record_has_them():
    """One value of a spring that stays, and the page says what a first spring is that steers."""
    record = walk(0.0, 0.3, duration=2.0, stops=[(1, 1.0)])
    springs = np.ones((record.sizes["time"], 2, record.sizes["joint"]))
    springs[:, 0, 0] = np.linspace(0.2, 1.0, len(springs))
    springs[record.time.values > 1.0, 1] = np.nan
    record["stiffness"] = (("time", "robot", "joint"), springs)
    robots = json.loads(Page(replay(record, titles=["a", "b"]).html).data)["robots"]
    steps = [[np.frombuffer(base64.b64decode(each), "<u2") / 65535 for each in robot["springs"]] for robot in robots]
    assert [robot["steers"] for robot in robots] == [True, False]
    assert steps[0][0][[0, -1]] == pytest.approx([0.2, 1.0], abs=1e-4)
    assert [len(each) for each in steps[0][1:] + steps[1]] == [1] * (2 * record.sizes["joint"] - 1)
    constant = json.loads(Page(replay(record.drop_vars("stiffness"), titles=["a", "b"]).html).data)["robots"]
    assert not any(robot["steers"] for robot in constant)
