"""Right-hand sides as tapes of operations, and their solutions by Taylor series in compiled code."""
