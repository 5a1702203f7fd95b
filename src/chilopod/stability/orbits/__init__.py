"""Periodic orbits as equations, and where their solution starts."""
