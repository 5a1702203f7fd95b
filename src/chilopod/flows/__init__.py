"""How a right-hand side becomes a flow with its derivative and its error; no module here knows of orbits."""
