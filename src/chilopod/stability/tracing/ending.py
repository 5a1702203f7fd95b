"""Ends of curves."""

from __future__ import annotations

from chilopod.labels import Labelled


class Ending(Labelled):
    """Reason for the end of a curve; each member's ``sentence`` describes it in words."""

    START = "start", "the curve was followed from here, the other way only"
    LEFT_INTERVAL = "left the interval", "the parameter reached an end of the interval"
    CLOSED = "closed", "the curve came back to where it started"
    RESONANCE = "resonance", "the two multipliers of the pair meet: here the curve ends indeed"
    ENOUGH_POINTS = "enough points", "as many points as were asked for"
    BUDGET = "budget", "as many flows as were allowed, or all of the time, were spent"
    LOST = "lost", "the step became too small: the curve could not be followed further"
