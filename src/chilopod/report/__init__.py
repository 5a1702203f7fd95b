"""The report: draws what the studies found, computes nothing."""

from chilopod.report.write import (
    files_of_branch,
    files_of_identification,
    write_branch,
    write_identification,
    write_report,
    write_undulation,
)

__all__ = [
    "files_of_branch",
    "files_of_identification",
    "write_branch",
    "write_identification",
    "write_report",
    "write_undulation",
]
