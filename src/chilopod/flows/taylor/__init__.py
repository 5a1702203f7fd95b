"""Flows of tapes by Taylor series in compiled code."""
