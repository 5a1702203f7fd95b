"""Tolerances of the tracer, the same for all curves, each with its reason.

Lengths are in the units of a curve, or parts of a step; angles are cosines.
"""

# Length of a step. A curve is lost at the shortest one, relative to the longest: it passes eight decades of a root.
SHORTEST = 1e-5
GROWTH, FALL, RETRY = 1.5, 0.6, 0.5  # factors after few corrections, after many, and after a failure
FEW, MANY = 4, 7  # corrections up to which the next step grows, and above which it is shorter
# Distance from the prediction, relative to the step, above which no step is longer than the longest. The cubic through
# both ends, for places in between, errs 64 times less: just within what these allow.
EASY = 5e-4
OVER = 2.0  # largest ratio of a step to an edge of the box to its planned length

# Corrections.
COUNTED = 1e-10  # error above which a correction counts: below it their number depends on rounding
SETTLED = 1e-8  # error that may stop falling, as an error of the equations: a flow errs by many times its tolerance
ROUND_OFF = 4e-15  # correction of a critical orbit that is rounding: its equations are nearly singular
MOST_CORRECTIONS = 12  # number after which a shorter step is cheaper
DIVERGING = 10.0  # growth from one correction to the next that shows divergence
SINGULAR = 1e-9  # singular value, relative to the largest, that counts as zero at a branch point, where it is rounding
LOOSE = 1e-6  # error of a solution, relative to the step, above which a weak matrix is replaced by a new one
STRAYS = 0.1  # distance beyond the box, relative to the step, on the way to a solution inside

# Signs of another curve: least cosines between a step and the tangent at its start, and between the tangents at both
# ends, also if events within a step are detected from its ends only; and distances from a prediction.
STRAIGHT = 0.7
SHARPEST_TURN = 0.5
SHARPEST_TURN_UNSEEN = 0.9
SURPRISE = 0.3  # distance of a step's end from the prediction, relative to the step, above which its middle is checked
AWAY = 0.1  # largest distance of the curve from the cubic through a step's ends, relative to the step
HIDDEN = 10.0  # length around a crossing that errors hide, relative to the root of theirs and the step's

# Closed curves.
NEAR = 0.05  # distance of the cubic from the start, relative to the step, below which the corrector is tried there
SAME = 1e-5  # largest distance of the end from the start, relative to the step: other curves pass farther away
