"""Figures of the whole robot in three dimensions."""
