r"""
Mathieu's equation and its chart
================================

A swing that is pumped, :math:`\ddot x + (a - 2 q \cos 2t)\,x = 0`, hangs still or swings up; which of the two, is for
a and q to decide. Charts of that, as Strutt drew them first, are usually contoured from a grid. Here the borders
themselves are followed as curves, each of their points with a bound on its error.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.special import mathieu_a, mathieu_b

from chilopod.stability import follow2, from_rhs, locate


def swing(t, x, a, q):
    return [x[1], -(a - 2.0 * q * np.cos(2.0 * t)) * x[0]]


def family(a, q):
    """The swing near its rest, which is the orbit in question."""
    return from_rhs(swing, 2, np.pi, args=(a, q), orbit=[0.0, 0.0])


# %%
# Along one line of the chart, q = 0.5, the multipliers leave the unit circle and come back to it at five points. They
# collide there in pairs, at +1 or -1: without damping there is no other way.

found = locate(lambda a: family(a, 0.5), (-1.0, 5.0))
for point in found:
    place = f"a = {point.value:.12f} ± {point.error_bound:.0e}"
    print(f"{point.kind.label} at {place}, multiplier {point.multiplier.real:+.0f}")

# %%
# Each of them is followed through the chart as both a and q change. Tables of these numbers exist, and scipy has them.

known = [(mathieu_a, 0), (mathieu_b, 1), (mathieu_a, 1), (mathieu_b, 2), (mathieu_a, 2)]
box = ((-8.0, 10.0), (0.0, 5.0))  # of a and q
curves = [follow2(family, point, box, second=0.5, coefficients=False).values.T for point in found]
off = max(np.abs(a - function(order, q)).max() for (a, q), (function, order) in zip(curves, known, strict=True))
print(f"{len(curves)} curves, at most {off:.0e} beside scipy's")

# %%
figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
for (a, q), name, side in zip(curves, ("a_0", "b_1", "a_1", "b_2", "a_2"), ("right", "left") * 3, strict=False):
    axes.plot(a, q, color="C0")
    axes.annotate(f"${name}$", (a[-1], q[-1]), (0, 4), textcoords="offset points", ha=side)
levels = np.linspace(0.0, 5.0, 200)
borders = [np.interp(levels, q, a) for a, q in curves]
for low, high in ((-8.0, borders[0]), borders[1:3], borders[3:5]):
    axes.fill_betweenx(levels, low, high, color="C3", alpha=0.2)
axes.text(-5.0, 2.0, "swings up", ha="center")
axes.text(0.5, 3.2, "swings up", ha="center")
axes.text(2.75, 0.3, "hangs still", ha="center")
axes.set(xlabel="a", ylabel="q", xlim=(-8.0, 9.0), ylim=(0.0, 5.4))
plt.show()
