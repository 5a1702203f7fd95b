"""Figures of curved walks."""
