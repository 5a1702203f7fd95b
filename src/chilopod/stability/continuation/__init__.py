"""One tracer for all curves."""
