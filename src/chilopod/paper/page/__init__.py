"""Page of the report: draws what the paper's sections found, computes nothing."""

from chilopod.paper.page.replacing import check_report
from chilopod.paper.page.report import Report, write_report

__all__ = ["Report", "check_report", "write_report"]
