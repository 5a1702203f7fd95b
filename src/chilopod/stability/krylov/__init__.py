"""Orbits and leading multipliers of large systems, from what the return map does to a few directions."""
