"""Flows of right-hand sides, with derivatives and errors; no module here uses periodic orbits."""
