"""Eigenvalues of a family of matrices on the unit circle: the search (``crossings``), its spectra, zeros and counts."""
