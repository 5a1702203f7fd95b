"""Page of the report: draws the results of the paper's sections, computes nothing."""

from chilopod.paper.page.report import Report, check_report

__all__ = ["Report", "check_report"]
