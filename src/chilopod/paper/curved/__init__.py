"""Curved walks of the planar model, trial by trial and along their branch."""
