"""The paper: the numbers it prints, and its experiments repeated; a folder for each chapter of the report."""

from chilopod.paper.sections import CHAPTERS, SECTIONS, Results, reproduce
from chilopod.paper.table import Row

__all__ = ["CHAPTERS", "SECTIONS", "Results", "Row", "reproduce"]
