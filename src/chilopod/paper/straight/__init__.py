"""The straight walk and its bifurcations."""
