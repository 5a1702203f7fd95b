"""Atlas of the planar robot: eight maps of its straight walk, and the scaling law of critical springs."""
