"""Equations of periodic orbits, and guesses of their solutions."""
