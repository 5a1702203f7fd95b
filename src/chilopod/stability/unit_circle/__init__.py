"""Eigenvalues of a family of matrices on the unit circle: zeros, counts and their errors."""
