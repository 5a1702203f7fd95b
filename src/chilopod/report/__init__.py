"""The report: draws what the paper's sections found, computes nothing."""

from chilopod.report.filling import Report, write_report
from chilopod.report.write import (
    files_of,
    write_branch,
    write_identification,
    write_undulation,
)

__all__ = [
    "Report",
    "files_of",
    "write_branch",
    "write_identification",
    "write_report",
    "write_undulation",
]
