"""Tolerances of the tracer, the same for all curves: each with the reason for it.

Lengths are in the units of a curve, or parts of a step; angles are cosines.
"""

SHORTEST = 1e-5
"""Step, relative to the longest, below which a curve is lost: eight decades of a root in its way are passed."""

GROWTH, FALL, RETRY = 1.5, 0.6, 0.5
"""Factors on a step after few corrections, after many, and after a failure."""

FEW, MANY = 4, 7
"""Corrections up to which a step grows, and above which the next one is shorter."""

COUNTED = 1e-10
"""Error above which a correction counts: below it rounding decides how many there are."""

SETTLED = 1e-8
"""Error that may no longer fall, for the equations are good to no more: a flow errs by many times its tolerance."""

ROUND_OFF = 4e-15
"""Correction of a critical orbit that is but rounding: its equations are nearly singular where the multiplier is."""

MOST_CORRECTIONS = 12
"""Corrections after which a shorter step is cheaper."""

DIVERGING = 10.0
"""Growth from one correction to the next that no curve comes back from."""

SINGULAR = 1e-9
"""Singular value, relative to the largest, that counts as zero where branches meet: rounding decides about it."""

LOOSE = 1e-6
"""Part of a step by which a solution may be off: with a weak matrix it is corrected with one of its own."""

STRAYS = 0.1
"""Part of a step beyond the box within which a curve may go on its way to a solution inside."""

STRAIGHT = 0.7
"""Least cosine between a step and the tangent where it starts: else it landed on another curve."""

SHARPEST_TURN = 0.5
"""Least cosine between the tangents at both ends of a step, for the same reason."""

SHARPEST_TURN_UNSEEN = 0.9
"""The same where the ends are all that events within a step are told by."""

SURPRISE = 0.3
"""Part of a step by which its end may miss the prediction before the curve is looked at half-way too."""

AWAY = 0.1
"""Part of a step by which the curve within it may miss the cubic through its ends: else that is another curve."""

OVER = 2.0
"""Most that a step to an edge of the box may be longer than it was to be."""

NEAR = 0.05
"""Part of a step by which the cubic passes the start of the curve, for the curve to be solved for there."""

SAME = 1e-5
"""Part of a step by which a curve may miss its start to be closed: other curves pass at more."""
