"""Flows of stiff tapes by implicit collocation in compiled code."""
