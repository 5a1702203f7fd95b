"""Finite groups of symmetries, what they make of a return map, and of what happens there."""
