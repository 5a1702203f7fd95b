"""Films decode, are as long and as large as asked for, and show what the record holds."""

import io

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from chilopod.errors import OutputError, ParameterError
from chilopod.show import style
from chilopod.show.scene.film import Film
from helpers.films import decoded
from helpers.walks import on_course, walk


def right_end_of(frame, color) -> float:
    """Pixels from the left to where something of nearly this colour ends, below the heading and above the key."""
    near = np.abs(frame[30:-40].astype(float) - 255.0 * np.array(to_rgb(color))).max(axis=-1) < 40.0
    return np.argwhere(near)[:, 1].max() if near.any() else np.nan


@pytest.mark.parametrize(("fps", "speed", "count"), [(25, 1.0, 26), (25, 4.0, 8), (30, 0.5, 61)])
def test_length_and_size(fps, speed, count):
    """What lies between two frames at the end has one of its own: it says what the walk came to."""
    shown = walk(0.0, 0.5, duration=1.0)
    film = Film(shown, titles=["a", "b"], heading="h", fps=fps, speed=speed, size=(480, 320)).mp4()
    assert film.index(b"moov") < film.index(b"mdat")  # the index stands in front
    assert decoded(film, rate=fps).shape == (count, 320, 480, 3)


def test_targets_of_a_course_appear_when_their_turn_comes():
    record = on_course(walk(0.0), [[[0.5, 0.0], [1.5, 0.0]]], [[[0.0, 3.0], [3.0, 6.0]]], [["given up", "given up"]])
    frames = decoded(Film(record, titles=["a"], heading="h", fps=1).mp4())
    x = [right_end_of(frame, style.GREEN) for frame in frames]
    assert x[0] == pytest.approx(x[2], abs=2.0)
    assert x[3] > x[2] + 50.0


def test_module_1_moves_to_the_right_until_the_robot_stops():
    record = walk(0.0, duration=4.0, stops=[(0, 2.01)])
    frames = decoded(Film(record, titles=["a"], heading="h", fps=10).mp4())
    # Stopped robots are pale, so that only moving ones have the colour of module 1.
    x = np.array([right_end_of(frame, style.BLUE) for frame in frames[:20]])
    assert (np.diff(x) > 0.0).all()
    assert np.isnan(right_end_of(frames[30], style.BLUE))

    def changed(one: int, other: int) -> float:
        """The part of the picture, below the clock, that is not the same."""
        return float((np.abs(frames[one].astype(int) - frames[other])[30:].max(axis=2) > 30).mean())

    assert changed(25, 35) < 1e-4  # nothing but the noise of the encoder along an edge
    assert changed(15, 35) > 1e-2


def test_the_poster_is_a_frame_of_the_last_third():
    shown, look = walk(0.5, duration=2.0), {"titles": ["a"], "heading": "h", "size": (480, 320)}
    picture = 255.0 * imread(io.BytesIO(Film(shown, **look).poster()))[..., :3]
    frames = decoded(Film(shown, **look).mp4()).astype(float)
    nearest = int(np.argmin(np.abs(frames - picture).mean(axis=(1, 2, 3))))
    assert 2 / 3 <= nearest / (len(frames) - 1) < 1


def test_a_film_that_follows_shows_its_robots_large():
    """Side by side, and however far they walk."""

    def sky(**how) -> int:
        film = Film(walk(0.0, 0.5, duration=20.0), titles=["a", "b"], heading="h", **how)
        picture = imread(io.BytesIO(film.poster()))
        return int((np.abs(picture[30:-40, :, :3] - to_rgb(style.SKY)).max(axis=-1) < 0.1).sum())

    assert sky(follow=True) > 3 * sky()


def test_robot_that_never_started():
    record = walk(0.0, 0.3, duration=0.4, stops=[(1, 0.0)], targets=[[0.3, 0.0], [np.nan, np.nan]])
    film = Film(record, titles=["x" * 200, "b"], heading="y" * 200, size=(240, 240)).mp4()
    assert decoded(film).shape == (11, 240, 240, 3)


def test_what_cannot_be_filmed(monkeypatch):
    record = walk(0.0, duration=0.2)
    for wrong in ({"size": (481, 320)}, {"size": (480, 100)}, {"fps": 0}, {"speed": 0.0}, {"speed": float("nan")}):
        with pytest.raises(ParameterError, match=next(iter(wrong))):
            Film(record, titles=["a"], heading="h", **wrong).mp4()
    monkeypatch.setattr("chilopod.show.scene.encoder.ENCODER", "no-such-encoder")
    with pytest.raises(OutputError, match="PyAV was built without the encoder"):
        Film(record, titles=["a"], heading="h").mp4()
