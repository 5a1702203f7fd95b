"""The report: draws what the paper's sections found, computes nothing."""

import logging

# Of folders that it cannot write matplotlib tells in three lines, and goes on.
logging.getLogger("matplotlib").setLevel(logging.ERROR)

from chilopod.report.filling import Report, write_report  # noqa: E402
from chilopod.report.replacing import check_report  # noqa: E402
from chilopod.report.scene.played import Replay, replay  # noqa: E402
from chilopod.report.write import (  # noqa: E402
    files_of,
    identification_files,
    write_branch,
    write_identification,
    write_undulation,
)

__all__ = [
    "Replay",
    "Report",
    "check_report",
    "files_of",
    "identification_files",
    "replay",
    "write_branch",
    "write_identification",
    "write_report",
    "write_undulation",
]
