r"""
Van der Pol's oscillator, whose period nobody knows
===================================================

:math:`\ddot x - \mu (1 - x^2) \dot x + x = 0` swings by itself: its motion has a period of its own, which is an unknown
like the motion itself. It is solved for along with it, and so are the multipliers, of which one, along the motion, is 1
and left out.
"""

import matplotlib.pyplot as plt
import numpy as np

from chilopod.stability import begin, exponents, follow, from_rhs, multipliers

plt.style.use("tableau-colorblind10")


def van_der_pol(t, x, mu):
    return [x[1], mu * (1.0 - x[0] ** 2) * x[1] - x[0]]


def family(mu):
    """``None`` for a period that is the orbit's own, and a guess of it."""
    return from_rhs(van_der_pol, 2, None, args=(mu,), guess_period=6.0)


# %%
# One oscillator
# --------------

found = multipliers(family(1.0), [2.0, 0.0])
print(f"period {found.period:.12f}, multiplier {found.values[0].real:.12f} ± {found.error_bound:.0e}")

# %%
# From a sine to a relaxation oscillation
# ---------------------------------------
# The motion is followed from a small μ, where it is nearly a sine of period 2π, to a large one, where it creeps and
# jumps.

branch = follow(family, begin(family, 0.1, [2.0, 0.0]), (0.1, 5.0))
branch

# %%
# The multiplier soon is too small to be told from zero. Its logarithm over the period, the Floquet exponent, is not:
# how fast a disturbance dies out is known at every μ.

mu = np.array([point.value for point in branch.points])
period = np.array([point.period for point in branch.points])
decay = [exponents(family(point.value), point.orbit).values[0].real for point in branch.points]
print(f"at μ = 5 the period is {period[-1]:.6f}, and a disturbance dies out by e^{decay[-1]:.4f} in a unit of time")

figure, (left, middle, right) = plt.subplots(1, 3, figsize=(11, 3.8), layout="constrained")
left.plot(mu, period)
left.axhline(2.0 * np.pi, linestyle="--", color="grey", linewidth=1)
left.annotate("2π", (5.0, 2.0 * np.pi), (0, 4), textcoords="offset points", ha="right")
left.set(xlabel="μ", ylabel="period", title="the period grows")
middle.plot(mu, decay)
middle.set(xlabel="μ", ylabel="Floquet exponent (1 / unit of time)", title="disturbances die out sooner")
for index in (0, len(mu) // 3, -1):
    point = branch.points[index]
    times = np.linspace(0.0, point.period, 1000)
    motion = np.array([family(point.value).flow(point.orbit, 0.0, time)[0] for time in times])
    right.plot(*motion.T, label=f"μ = {point.value:.2g}")
right.set(xlabel="x", ylabel="velocity", title="the motion")
right.legend()
plt.show()
