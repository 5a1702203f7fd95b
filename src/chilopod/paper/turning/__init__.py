"""Turning to targets with the planar model."""
