"""Figures of turning to a target."""
