"""Right-hand sides as tapes of operations, their values and their Taylor series."""
