"""Notebooks for teaching run from top to bottom: exercises wait for an answer, and their answers are right."""

import re
from pathlib import Path
from types import SimpleNamespace

import matplotlib as mpl
import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pytest

from chilopod import load_robot
from chilopod.notebook import check

LESSONS = sorted((Path(__file__).parents[1] / "docs" / "lessons").glob("*.ipynb"))
ANSWER = re.compile(r"<details><summary>Answer</summary>.*^```python\n(.*?)^```", re.M | re.S)


@pytest.mark.slow
@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.stem)
def test_exercises_wait_for_their_answers(lesson, capsys, monkeypatch):
    monkeypatch.setattr(plt, "show", lambda: None)
    mpl.use("Agg")
    names, before, waiting, answered = {}, {}, "", 0
    for cell in nbformat.read(lesson, as_version=4).cells:
        answer = ANSWER.search(cell.source)
        if cell.cell_type == "code":
            before = dict(names)
            exec(cell.source, names)
            waiting = cell.source if capsys.readouterr().out.startswith("Not answered yet.") else ""
        elif answer:
            assert waiting, cell.source
            open_line = re.compile(r"^(\w+ = \.\.\.|def \w+\(\w+\):\n    return \.\.\.)$", re.MULTILINE)
            solved = open_line.sub(lambda _, lines=answer[1]: lines, waiting, count=1)
            exec(solved, before)  # as in a notebook that is run anew
            names = before
            assert capsys.readouterr().out.endswith("Right.\n"), cell.source
            answered += 1
    assert 4 <= answered <= 6


@pytest.mark.parametrize("wrong", [lambda e: max(5.0 * e, 0.0), lambda e: 0.2 if e > 0.0 else 0.0])
def test_a_branch_is_checked_at_two_places(wrong, capsys):
    cells = nbformat.read(LESSONS[1], as_version=4).cells
    (source,) = (cell.source for cell in cells if "def settled(epsilon):\n    return ..." in cell.source)
    exec(source.replace("def settled(epsilon):\n    return ...", ""), {"settled": wrong, "check": check})
    assert capsys.readouterr().out == "Not yet. It is not zero for every epsilon; try 0.01.\n"


def test_an_answer_is_checked(capsys):
    conditions = {"It is negative.": lambda x: x > 0, "It is no square.": lambda x: (x**0.5).is_integer()}
    for answer in (..., -1.0, 2.0, "4", 4.0):
        check(answer, conditions)
    first, *others = capsys.readouterr().out.splitlines()
    assert first.startswith("Not answered yet.")
    assert others[:2] == ["Not yet. It is negative.", "Not yet. It is no square."]
    assert others[2].startswith("Not yet. This answer cannot be checked: '>' not supported")
    assert others[3:] == ["Right."]


@pytest.mark.parametrize(("radius", "said"), [(np.nan, "spring is too soft"), (0.6, "wider"), (0.4, "tighter")])
def test_a_circle_is_checked(radius, said, capsys):
    cells = nbformat.read(LESSONS[3], as_version=4).cells
    (source,) = (cell.source for cell in cells if "def radius(spring):" in cell.source)
    walk = SimpleNamespace(summaries=[SimpleNamespace(axis_radius=radius)])
    names = {"robot": load_robot("aoi2022-planar"), "walk": lambda *_, **__: walk, "np": np, "check": check}
    exec(source.replace("spring = ...", "spring = 9.0"), names)
    assert said in capsys.readouterr().out
