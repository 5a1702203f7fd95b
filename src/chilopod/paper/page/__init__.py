"""Page of the report: draws what the paper's sections found, computes nothing."""

from chilopod.paper.page.report import Report, check_report, write_report

__all__ = ["Report", "check_report", "write_report"]
