"""The straight walk and where it bends."""
