"""Finite groups of symmetries, and their effect on return maps and bifurcations."""
