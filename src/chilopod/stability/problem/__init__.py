"""Interface of systems to the analyses: capabilities, return map, sizes of the states, and the budget of a search."""
