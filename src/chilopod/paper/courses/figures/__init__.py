"""Figures of random courses."""
