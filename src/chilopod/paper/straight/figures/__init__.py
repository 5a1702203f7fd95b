"""Figures of the straight walk and where it bends."""
