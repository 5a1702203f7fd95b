"""
A cycle beside chaos
====================

Where does a cycle come from, and what does it become? The documentation of Attractors.jl looks for the attractors of a
system like Lorenz's, with a kink, over its parameter a (https://juliadynamics.github.io/Attractors.jl/stable/tutorial/).
One of them is a cycle. Its branch, with the orbits that do not attract, tells where it begins and ends.
"""

import matplotlib.pyplot as plt

from chilopod.stability import begin, follow, from_rhs, switch


def system(a):
    return from_rhs(
        lambda t, x: [x[1] - x[0], -x[0] * x[2] + 0.1 * abs(x[2]), x[0] * x[1] - a], 3, None, guess_period=4.7
    )


guess = [2.32, -1.27, 2.80]  # a state of a simulation that has settled

# %%
# Upwards the cycle meets an unstable one and both vanish: a fold, round which the branch goes on.

upward = follow(system, begin(system, 5.0, guess), (4.85, 6.0))
print(upward)

# %%
# Downwards its period doubles. The new orbits, of two rounds, are stable: what comes below 4.945 is no longer this
# cycle, but close to it.

downward = follow(system, begin(system, 5.0, guess, rising=False), (4.85, 6.0))
(doubling,) = downward.special_points
(start,) = switch(system, doubling)
doubled = follow(system, start, (4.85, 6.0))
print(doubled)

# %%

figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
for branch in (upward, downward, doubled):
    branch.plot(axes)
handles, labels = axes.get_legend_handles_labels()
first = {label: handle for handle, label in zip(handles, labels, strict=True)}
axes.legend(first.values(), first.keys())
axes.set(xlabel="a", ylabel="x at time 0", title="one cycle: born in a fold, doubled before chaos")
plt.show()
