"""Tolerances of the tracer, the same for all curves, each with its reason.

Lengths are in the units of a curve, or parts of a step; angles are cosines.
"""

SHORTEST = 1e-5
"""Step, relative to the longest, below which a curve is lost: it passes eight decades of a root."""

GROWTH, FALL, RETRY = 1.5, 0.6, 0.5
"""Factors on a step after few corrections, after many, and after a failure."""

FEW, MANY = 4, 7
"""Numbers of corrections up to which the next step grows, and above which it is shorter."""

EASY = 1e-5
"""Distance of an end from the prediction, relative to the step, above which no step is longer than the longest."""

COUNTED = 1e-10
"""Error above which a correction counts: below it their number depends on rounding."""

SETTLED = 1e-8
"""Error that may stop falling, as an error of the equations: a flow errs by many times its tolerance."""

ROUND_OFF = 4e-15
"""Correction of a critical orbit that is rounding: a critical multiplier makes its equations nearly singular."""

MOST_CORRECTIONS = 12
"""Corrections after which a shorter step is cheaper."""

DIVERGING = 10.0
"""Growth from one correction to the next that shows divergence."""

SINGULAR = 1e-9
"""Singular value, relative to the largest, that counts as zero at a branch point, where it is rounding."""

LOOSE = 1e-6
"""Error of a solution, relative to the step, above which a weak matrix is replaced by a new one."""

STRAYS = 0.1
"""Distance beyond the box, relative to the step, that the corrector may take on its way to a solution inside."""

STRAIGHT = 0.7
"""Least cosine between a step and the tangent at its start: a smaller one shows another curve."""

SHARPEST_TURN = 0.5
"""Least cosine between the tangents at both ends of a step, for the same reason."""

SHARPEST_TURN_UNSEEN = 0.9
"""The same if events within a step are detected from its ends only."""

SURPRISE = 0.3
"""Distance of a step's end from the prediction, relative to the step, above which the curve is checked half-way."""

AWAY = 0.1
"""Largest distance of the curve from the cubic through a step's ends, relative to it; more shows another curve."""

OVER = 2.0
"""Largest ratio of a step to an edge of the box to its planned length."""

NEAR = 0.05
"""Distance of the cubic from the curve's start, relative to the step, below which the corrector is tried there."""

SAME = 1e-5
"""Largest distance of a closed curve from its start, relative to the step: other curves pass farther away."""
