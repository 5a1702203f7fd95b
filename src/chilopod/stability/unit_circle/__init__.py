"""Where eigenvalues of a family of matrices meet the unit circle: zeros, counts and their errors."""
