"""Flows of stiff right-hand sides."""
