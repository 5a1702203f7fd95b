"""Lists of eigenvalues, compared."""


def farthest(found, known):
    """Largest distance between two lists of numbers, each of one paired with the nearest that is left of the other."""
    left, worst = list(known), 0.0
    assert len(found) == len(left)
    for value in found:
        nearest = min(range(len(left)), key=lambda i: abs(left[i] - value))
        worst = max(worst, abs(left.pop(nearest) - value))
    return worst
