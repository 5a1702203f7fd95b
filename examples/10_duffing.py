r"""
The Duffing oscillator breaks its symmetry
==========================================

The stability layer knows nothing of robots. Here it finds where a driven spring that gets stiffer as it stretches,
:math:`\ddot x + 0.2\,\dot x + x^3 = F \cos t`, begins to swing farther to one side than to the other.
"""

import matplotlib.pyplot as plt
import numpy as np

from chilopod.stability import begin, follow, from_rhs, locate, switch

plt.style.use("tableau-colorblind10")


def duffing(t, x, force):
    return [x[1], force * np.cos(t) - 0.2 * x[1] - x[0] ** 3]


def family(force):
    """The oscillator at one force; with x(t), -x(t) half a period later is a motion too."""
    return from_rhs(duffing, 2, 2.0 * np.pi, args=(force,), symmetry=-np.eye(2))


# %%
# Where
# -----
# The symmetric motion loses its stability at a **pitchfork**, which is located with a bound on its error.

(point,) = locate(family, between=(2.3, 2.5), orbit=[1.9, 0.6])
print(f"{point.criticality.label} {point.kind.label} at F = {point.value:.12f} ± {point.error_bound:.0e}")
point

# %%
# What then
# ---------
# The symmetric motion goes on, but no longer lasts. Two lopsided ones branch off, mirror images of each other.

between = (2.3, 2.7)
symmetric = follow(family, begin(family, 2.3, [1.9, 0.6], symmetric=True), between, symmetric=True)
lopsided = [follow(family, start, between) for start in switch(family, point)]
for each in (symmetric, *lopsided):
    print(f"{len(each.points)} points to F = {each.points[-1].value:g}, stable there: {each.points[-1].stable}")
lopsided[0]

# %%
# A motion is drawn by where x is at time 0; solid where it lasts, dashed where it does not.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for branch in (symmetric, *lopsided):
    branch.plot(left)
left.set(xlabel="force F", ylabel="x at time 0", title="one motion, and two more")

times = np.linspace(0.0, 2.0 * np.pi, 200)
for branch, color in zip((symmetric, *lopsided), ("C0", "C1", "C2"), strict=True):
    end = branch.points[-1]
    system = family(end.value)
    motion = np.array([system.flow(end.orbit, 0.0, time)[0] for time in times])
    right.plot(*motion.T, color=color)
right.set(xlabel="x", ylabel="velocity", title=f"the motions at F = {end.value:g}")
plt.show()
