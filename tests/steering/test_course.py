"""Courses: how they are read, where their targets lie, and what is none."""

import math
import os

import numpy as np
import pytest

from chilopod.errors import ChilopodError, ParameterError
from chilopod.steering import COURSES, Course, Goal, course_named, random_course

AHEAD = Goal(1.0, 0.0, relative=True)


def test_goals_are_directions_or_places():
    assert Goal.parse("1.2 m, 50 cm") == Goal(1.2, 0.5, relative=False)
    goal = Goal.parse(" -150deg , 2 m")
    assert goal.relative
    assert (goal.x, goal.y) == pytest.approx((-math.sqrt(3.0), -1.0))
    for text in ("-150 deg, 2 m", "180 deg, 1.3 m", "1.2 m, -0.5 m"):
        assert str(Goal.parse(text)) == text


def test_equal_courses_are_written_alike():
    assert repr(Course((Goal(1, np.float32(2), relative=True),), 40)) == repr(
        Course((Goal(1.0, 2.0, relative=True),), 40.0)
    )


def test_places_seen_from_the_robot_turn_with_it():
    poses = np.array([[0.0, 0.0, 0.0], [2.0, 1.0, 0.5 * math.pi]])
    assert Goal(1.0, 0.5, relative=True).place(poses) == pytest.approx(np.array([[1.0, 0.5], [1.5, 2.0]]))
    assert Goal(1.0, 0.5, relative=False).place(poses) == pytest.approx(np.array([[1.0, 0.5], [1.0, 0.5]]))


@pytest.mark.parametrize("name", COURSES)
def test_named_courses(name):
    course = course_named(name, 40.0)
    assert course.goals == COURSES[name]
    assert course.duration == 40.0 * len(course.goals)


def test_random_courses_come_from_their_seed():
    rng = np.random.default_rng(3)
    bearings, distances = rng.uniform(-75.0, 75.0, 5), rng.uniform(0.8, 2.0, 5)
    goals = course_named("random:3", 40.0).goals
    assert [math.degrees(math.atan2(each.y, each.x)) for each in goals] == pytest.approx(bearings)
    assert [math.hypot(each.x, each.y) for each in goals] == pytest.approx(distances)
    assert random_course(3, 40.0).goals == goals
    assert random_course(4, 40.0).goals != goals
    assert len(random_course(3, 40.0, count=2).goals) == 2


def test_a_file_is_what_is_typed(tmp_path):
    text = "45 deg, 1.3 m; 1.2 m, 0.5 m"
    file = tmp_path / "a, b"
    file.write_text("# two targets\n45 deg, 1.3 m  # first\n\n 1.2 m, 0.5 m\n")
    assert course_named(str(file), 40.0) == course_named(text, 40.0)
    assert str(course_named(text, 40.0)) == text


def test_the_same_place_twice_is_no_target_unless_the_robot_was_elsewhere():
    assert len(course_named("1 m, 0 m; 2 m, 0 m; 1 m, 0 m", 40.0).goals) == 3
    for text, which in (
        ("1 m, 0 m; 1.1 m, 0.1 m", "target 2 = '1.1 m, 0.1 m': must lie apart from target 1"),
        ("10 cm, 0 m", "target 1 = '0.1 m, 0 m': must lie apart from the start"),
    ):
        with pytest.raises(ParameterError, match=which):
            course_named(text, 40.0)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "must be targets, a named course"),
        ("slalon", "did you mean 'slalom'"),
        ("randm:1", "did you mean 'random:1'"),
        ("random", "did you mean 'random:1'"),
        ("random:", "must end with a seed"),
        ("random:-1", "must end with a seed"),
        ("random:²", "must end with a seed"),
        pytest.param("random:" + "9" * 5000, "must end with a seed", id="long seed"),
        ("missing.course", "a named course or an existing file"),
        ("1 m, 1 m\0", "target 1"),
        ("45 deg, 1.3 m;", "target 2 = '': must be a target"),
        ("45 deg", "must be targets, a named course"),
        ("45 deg; 1 m, 2 m", "target 1 = '45 deg': must be a target"),
        ("1 m, 1 m; here, there", "target 2 = 'here, there': must be a target"),
        ("1 m, 1 m; 45, 1.3", "target 2 = '45, 1.3': must have a unit"),
        ("45 deg, 1.3 s", "target 1 = '1.3 s': is a time"),
        ("1 m, 1 m, 1 m", "target 1"),
        ("181 deg, 1 m", "-180 to 180 deg"),
        ("45 deg, -1 m", "a positive distance"),
        ("45 deg, 0.15 m", "target 1 = '0.15 m': must be a distance"),
        ("45 deg, 10001 m", "must be a distance"),
        ("20 km, 0 m", "must be a distance"),
        ("nan m, 1 m", "target 1"),
        ("1e400 m, 1 m", "target 1"),
        pytest.param(
            "1 m, 1 m;" * 10**6, "targets = 1000001: must be a number of targets; allowed: 1 to 1000", id="many"
        ),
    ],
)
def test_what_is_no_course(text, complaint):
    with pytest.raises(ChilopodError) as caught:
        course_named(text, 40.0)
    assert complaint in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "is empty"),
        (b"# nothing\n", "targets = 0"),
        (b"45 deg, 1.3 m\n1 m\n", "target 2 = '1 m': must be a target"),
        pytest.param(b"1 m, 1 m\n" * 1001, "targets = 1001", id="many"),
        pytest.param(b"1 m, 1 m\n" * 10**6, "too large for a course", id="too many"),
        (b"\x00\xff\xfe", "not a text file"),
    ],
)
def test_files_that_are_no_course(tmp_path, content, complaint):
    file = tmp_path / "course"
    file.write_bytes(content)
    with pytest.raises(ParameterError) as caught:
        course_named(str(file), 40.0)
    assert str(caught.value).startswith(f"{file}: ")
    assert complaint in str(caught.value)


def test_pipes_and_folders_are_no_course(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ParameterError, match="not a regular file"):
        course_named(str(tmp_path / "pipe"), 40.0)
    with pytest.raises(ParameterError, match="is a folder, not a course"):
        course_named(str(tmp_path), 40.0)


@pytest.mark.parametrize("number", [math.nan, math.inf, -1.0, 0.0, 2e4])
def test_patience_view_and_range_within_reason(number):
    for field in ("patience", "view", "range"):
        with pytest.raises(ParameterError, match=field):
            Course(**{"goals": (AHEAD,), "patience": 40.0, field: number})


@pytest.mark.parametrize("place", [(math.nan, 0.0), (math.inf, 0.0), (1e4, 1e4), (0.1, 0.1)])
def test_goals_too_near_or_too_far(place):
    with pytest.raises(ParameterError, match="a distance to walk"):
        Goal(*place, relative=True)
