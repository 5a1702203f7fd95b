"""A system as the analyses see it: capabilities, return map, sizes of its states, and the budget of a search."""
