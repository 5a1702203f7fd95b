"""Search for the bifurcations of an orbit in an interval of a parameter."""
