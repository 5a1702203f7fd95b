"""What is said of courses, on made-up ones: nothing that the intervals do not decide."""

import numpy as np
import pytest

from chilopod.paper.courses.rows import compared_rows, robust_rows, summaries, verdicts
from chilopod.paper.table import Verdict
from helpers.made_up_courses import compared, conditions

OTHERS = ["first spring 15", "all springs 7", "leg-yaw", "actuated"]


def test_every_number_of_a_strategy():
    found = summaries(compared())["actuated"]
    assert (found.targets.value, found.courses.value) == (0.6, 0.0)
    assert found.seconds.value == pytest.approx(2.0 * np.mean(10.0 + np.arange(40) % 7))
    assert found.spent.value == pytest.approx((3.0 * found.seconds.value + 2.0 * 40.0) / 3.0)
    assert found.later.value == pytest.approx(found.seconds.value / 2.0)
    assert (found.more_work.value, found.drive_work) == (45.0, 50.0)
    assert (found.detour, found.effort, found.cost) == (1.0, 5.0, 0.1)


def test_a_robot_that_folds_is_not_quick():
    """It has no time at the targets that it never set out for: each counts with its whole patience."""

    def folds(seconds):
        seconds[1:, :, 1] = 3.0
        seconds[1:, :, 2:] = np.nan
        return seconds

    def first_only(arrived):
        arrived[1:, :, 1:] = 0.0
        return arrived

    found = summaries(compared(seconds=folds, arrived=first_only))["leg-yaw"]
    assert found.spent.value == pytest.approx(found.seconds.value + 4.0 * 40.0)


def test_what_the_intervals_decide_is_said():
    found = verdicts(summaries(compared()))
    assert {words: names for words, names in found.items() if names} == {
        "reaches more targets than": OTHERS,
        "spends less time for every target reached than": OTHERS,
        "is sooner at targets that both reach than": OTHERS,
        "does less work than": ["actuated"],
    }
    rows = compared_rows(compared())
    assert len(rows) == 6
    assert {row.verdict for row in rows} == {Verdict.NOT_PRINTED}
    assert "reaches more targets than first spring 15, all springs 7, leg-yaw and actuated" in rows[-1].computed.words


def test_what_they_leave_open_is_called_open():
    found = verdicts(summaries(compared(courses=2)))
    assert found["reaches as many, for all that can be told, as"] == OTHERS
    same = verdicts(summaries(compared(seconds=np.ones_like, goal_drive_work=np.zeros_like)))
    assert same["is there as soon, for all that can be told, as"] == OTHERS
    assert same["does less work than"] == []


def test_who_reaches_nothing_has_no_time():
    rows = compared_rows(compared(arrived=np.zeros_like))
    assert "nan" not in " ".join(f"{row.computed.words} {row.remark}" for row in rows)


def test_steps_and_conditions():
    steps = compared().isel(case=slice(4))
    rows = robust_rows(steps, conditions(worse=["one"]))
    assert [row.quantity for row in rows][1:] == [f"40 courses, {name}" for name in ("as usual", "one", "another")]
    # Of targets that are all alike on a course no more is known than of courses.
    assert "variable 0.0 % (0.0 to 8.8) of targets, 0.0 % (0.0 to 8.8) of courses" in rows[2].computed.words
    assert "first spring 15 80.0 %" in rows[3].computed.words
