"""Reports of results that were computed before."""

from __future__ import annotations

from pathlib import Path

from chilopod.paper.page import Report
from chilopod.paper.section import Found


def write_report(found: Found, folder: str | Path) -> Path:
    """Draw all results and write the page; return the path of the page."""
    sections = [*found.values, *found.failures]
    with Report(sections, found.context, folder) as report:
        report.add(found, sections)
    for section, error in report.failures.items():
        if section not in found.failures:
            raise error
    return report.page
