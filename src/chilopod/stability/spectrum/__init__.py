"""Eigenvalues of return maps, bounds on their errors, and products of matrices split by scale."""
