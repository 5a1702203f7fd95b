"""A report replaces what has no more than itself; anything else only if told."""

import os

import pytest

from chilopod.errors import OutputError
from chilopod.paper.page import check_report
from chilopod.paper.page.page import Drawings, State, page
from chilopod.paper.section import Context, Found, Size
from chilopod.paper.straight.sections import MODE, UNIFORM


def written(folder, sections, size):
    found = Found(Context(size=size), {section: None for section in sections})
    folder.mkdir(exist_ok=True)
    html = page(Found(found.context), [], Drawings(), "aoi2022-planar", State.STOPPED)
    names = " ".join([size.name, *(section.name for section in sections)])
    (folder / "index.html").write_text(html.replace(f'"{size.name}"', f'"{names}"'), encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("had", "has", "why"),
    [
        (([MODE], Size.QUICK), ([MODE], Size.QUICK), ""),
        (([], Size.TINY), ([MODE], Size.TINY), ""),
        (([MODE], Size.TINY), ([MODE, UNIFORM], Size.FULL), ""),
        (([MODE, UNIFORM], Size.QUICK), ([MODE], Size.QUICK), "has more (uniform)"),
        (([MODE], Size.FULL), ([MODE, UNIFORM], Size.QUICK), "has more (it is full)"),
    ],
)
def test_what_has_more_is_only_replaced_if_told(tmp_path, had, has, why):
    folder = written(tmp_path / "report", *had)
    check_report(folder, *has, replace=True)
    if not why:
        check_report(folder, *has)
        return
    with pytest.raises(OutputError) as refused:
        check_report(folder, *has)
    assert why in str(refused.value)


def test_files_of_others_are_not_taken_for_those_of_a_report(tmp_path):
    check_report(tmp_path / "new", [MODE], Size.TINY)
    (tmp_path / "data").mkdir()
    check_report(tmp_path, [MODE], Size.TINY)
    (tmp_path / "data" / "robot.toml").write_text("precious")
    with pytest.raises(OutputError, match="data: has files that are of no report"):
        check_report(tmp_path, [MODE], Size.TINY)
    check_report(tmp_path, [MODE], Size.TINY, replace=True)
    os.mkfifo(tmp_path / "index.html")
    with pytest.raises(OutputError, match="not a regular file"):
        check_report(tmp_path, [MODE], Size.TINY, replace=True)
    assert not (tmp_path / "new").exists()
