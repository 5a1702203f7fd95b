"""Rules for writing a report into a folder: other files are only replaced if that was asked for."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path
from typing import Any

from chilopod.errors import OutputError
from chilopod.output import check_files
from chilopod.paper.section import Section, Size

_HOLDS = re.compile('<meta name="chilopod-report" content="([A-Z]+)([^"]*)">')
_FRONT = 1000  # characters of a page, in which that stands
_BESIDE = ("data", "figures", "movies")


def check_report(folder: Path, sections: Collection[Section[Any]], size: Size, *, replace: bool = False) -> None:
    """Make sure, before any work is done for it, that a report can be written into a folder.

    Parameters
    ----------
    folder
        Folder of the report.
    sections, size
        Sections and size of the new report. A report that has no more is resumed.
    replace
        True to replace whatever is there.

    Raises
    ------
    OutputError
        If there is a page that is no report, a report that has more, or files beside which there is no page; or if the
        folder cannot be written.
    """
    page = folder / "index.html"
    held = _held(page)
    check_files([page], replace=replace or held is not None)
    if replace:
        return
    if held is None:
        for beside in _BESIDE:
            if (folder / beside).is_dir() and any((folder / beside).iterdir()):
                problem = "has files that are of no report and might be replaced, which takes --force"
                raise OutputError(problem, source=str(folder / beside))
        return
    done, names = held
    larger = [f"it is {done.name.lower()}"] if list(Size).index(done) < list(Size).index(size) else []
    more = larger or sorted({*names} - {section.name for section in sections})
    if more:
        problem = f"is a report that has more ({', '.join(more)}) and is only replaced with --force"
        raise OutputError(problem, source=str(page))


def _held(page: Path) -> tuple[Size, list[str]] | None:
    """Size and sections of a report; None if it is none."""
    if not page.is_file():
        return None
    with page.open(encoding="utf-8", errors="replace") as file:
        found = _HOLDS.search(file.read(_FRONT))
    return (Size[found[1]], found[2].split()) if found and found[1] in Size.__members__ else None
