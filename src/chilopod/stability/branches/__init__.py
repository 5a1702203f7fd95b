"""Branches of periodic orbits in one parameter."""
