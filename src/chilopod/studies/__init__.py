"""Studies: conditions in, results out. One module for each figure or table of the paper."""

from chilopod.studies.reproduce import CHAPTERS, SECTIONS, Results, reproduce
from chilopod.studies.table import Row

__all__ = ["CHAPTERS", "SECTIONS", "Results", "Row", "reproduce"]
