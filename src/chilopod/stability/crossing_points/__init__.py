"""Points where multipliers cross the unit circle: place, error bound and description."""
