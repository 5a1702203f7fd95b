"""Page in which the planar robot walks in the browser, with nothing to install."""

from chilopod.show.play.page import motion, play

__all__ = ["motion", "play"]
