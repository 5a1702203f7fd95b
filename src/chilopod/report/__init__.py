"""The report: draws what the paper's sections found, computes nothing."""

from chilopod.report.filling import Report, write_report
from chilopod.report.replacing import check_report
from chilopod.report.write import (
    files_of,
    identification_files,
    write_branch,
    write_identification,
    write_undulation,
)

__all__ = [
    "Report",
    "check_report",
    "files_of",
    "identification_files",
    "write_branch",
    "write_identification",
    "write_report",
    "write_undulation",
]
