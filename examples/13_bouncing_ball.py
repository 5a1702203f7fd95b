r"""
A ball that bounces on a table
==============================

A table shakes up and down, a ball bounces on it, and every impact keeps half of the speed between them: a **hybrid**
system, which flies by an equation and jumps by another. Shaken gently enough, the ball bounces once a period of the
table.
"""

import matplotlib.pyplot as plt
import numpy as np

from chilopod.stability import Event, begin, follow, from_rhs, locate, switch

plt.style.use("tableau-colorblind10")

GRAVITY, KEPT, RATE = 9.81, 0.5, 60.0  # m/s^2, of the speed, rad/s


def table(t, amplitude):
    return amplitude * np.sin(RATE * t + 2.0)


def bounce(t, x, amplitude):
    upward = amplitude * RATE * np.cos(RATE * t + 2.0)
    return [x[0], upward - KEPT * (x[1] - upward)]


# %%
# An **event** is where its guard passes zero, falling here; the ball then goes on from another state. How a disturbance
# comes out of an impact is known exactly.

impact = Event(guard=lambda t, x, amplitude: x[0] - table(t, amplitude), reset=bounce, direction=-1)


def family(amplitude):
    """The ball over one period of a table with this amplitude, m."""
    return from_rhs(lambda t, x, amplitude: [x[1], -GRAVITY], 2, 2.0 * np.pi / RATE, args=(amplitude,), events=[impact])


# %%
# Shaken harder, the ball soon bounces high and low in turns: the period doubles. Where, is known in closed form, too.

between = (3.3e-3, 4.6e-3)  # m
(doubling,) = locate(family, between, orbit=[0.0138, 0.331])
q = (1.0 - KEPT) / (1.0 + KEPT)
exact = GRAVITY / RATE**2 * np.hypot(np.pi * q, 1.0 + q**2)
print(f"{doubling.kind.label} at {1e3 * doubling.value:.12f} mm, in closed form {1e3 * exact:.12f} mm")
doubling

# %%
# And it doubles again. Each branch is followed through the point where it loses its stability and the next one begins.

once = follow(family, begin(family, between[0], [0.0138, 0.331]), between)
(start,) = switch(family, doubling)
twice = follow(family, start, between)
(*_, again) = twice.special_points
(start,) = switch(family, again, periods=twice.periods)
four = follow(family, start, between)
print(f"{again.special.label} again at {1e3 * again.value:.6f} mm")

# %%
# Where the ball is whenever the table begins a new period; solid where the motion lasts, dotted where it does not.

period = 2.0 * np.pi / RATE
figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 4), layout="constrained")
for color, branch in (("C0", once), ("C1", twice), ("C2", four)):
    amplitude = np.array([point.value for point in branch.points])
    lasts = np.array([point.stable or point.special is not None for point in branch.points])
    for turn in range(branch.periods):
        height = [family(each.value).flow(each.orbit, 0.0, turn * period)[0][0] for each in branch.points]
        left.plot(1e3 * amplitude, 1e3 * np.array(height), ":", color=color)
        left.plot(1e3 * amplitude, 1e3 * np.where(lasts, height, np.nan), color=color)
left.set(
    xlabel="amplitude of the table (mm)", ylabel="ball at the start of a period (mm)", title="once, twice, four times"
)

last = four.points[-1]
times = np.linspace(0.0, 8.0 * period, 800)
heights = [family(last.value).flow(last.orbit, 0.0, time)[0][0] for time in times]
right.plot(1e3 * times, 1e3 * np.array(heights), color="C2", label="ball")
right.plot(1e3 * times, 1e3 * table(times, last.value), color="black", label="table")
right.set(xlabel="time (ms)", ylabel="height (mm)", title=f"a table that moves by {1e3 * last.value:.2f} mm")
right.legend(loc="upper right", framealpha=1.0)
plt.show()
