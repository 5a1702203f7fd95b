"""Results print as a few lines, whatever is in them."""

from dataclasses import dataclass

import numpy as np
import pytest

from chilopod import load_robot, stability
from chilopod.analysis import bifurcations, straight_walk
from chilopod.analysis.parameters import K1, stiffness
from chilopod.errors import ParameterError
from chilopod.frozen import ReadOnlyArrays, Short
from chilopod.stability import from_rhs
from chilopod.tasks import walk

ROBOT = load_robot("aoi2022-planar")


def duffing(force):
    return from_rhs(
        lambda t, y, force: [y[1], -0.2 * y[1] - y[0] - y[0] ** 3 + force * np.cos(t)], 2, 2 * np.pi, args=(force,)
    )


@pytest.mark.parametrize(
    "made",
    [
        lambda: straight_walk(ROBOT),
        lambda: straight_walk(ROBOT).exponents,
        lambda: bifurcations(ROBOT, K1, (stiffness(11.0), stiffness(13.0)))[0].point,
        lambda: stability.follow(duffing, [0.1, 0.0], (0.1, 0.5), points=5),
        lambda: walk(ROBOT, 0.6),
    ],
)
def test_a_result_prints_as_a_few_lines(made):
    result = made()
    for text in (repr(result), str(result), repr([result])):
        lines = text.splitlines()
        assert len(lines) <= 15
        assert max(map(len, lines)) <= 120
        assert type(result).__name__ in lines[0]


def test_what_is_small_is_shown_and_what_is_large_is_named():
    @dataclass(frozen=True)
    class Found(ReadOnlyArrays):
        value: float
        few: np.ndarray
        many: np.ndarray
        words: str
        parts: tuple
        nothing: None = None

    found = Found(0.1, np.array([1.0, 0.5]), np.zeros((9, 9)), 1000 * "word ", (Found,) * 3)
    assert repr(found).splitlines()[1:-1] == [
        "    value=0.1", "    few=[1. , 0.5]", "    many=<float64 array of shape (9, 9)>", "    words=<str of 5000>",
        "    parts=<3 times type>", "    nothing=None",
    ]  # fmt: skip
    assert "\n" not in str(ParameterError("is none", field="found", value=found))


def test_a_text_of_its_own_is_kept():
    @dataclass(frozen=True)
    class Own(Short):
        value: float

        def __repr__(self):
            return "own"

    assert repr(Own(1.0)) == "own"
