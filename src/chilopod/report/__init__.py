"""The report: draws what the studies found, computes nothing."""

from chilopod.report.write import write_branch, write_identification, write_report, write_undulation

__all__ = ["write_branch", "write_identification", "write_report", "write_undulation"]
