"""
The pitchfork in two parameters
===============================

Where the straight walk gives way hangs on more than the spring. Here the pitchfork is followed as the feet move forward
under their modules, too; on the way it changes its nature.
"""

import matplotlib.pyplot as plt
import numpy as np

from chilopod import load_robot, units
from chilopod.analysis import transition_curve
from chilopod.stability import Kind

robot = load_robot("aoi2022-planar")
springs = tuple(units.parse(text, "N*m/rad") for text in ("7 N*mm/deg", "16 N*mm/deg"))
offsets = (0.01, 0.07)  # m

# %%
# The curve is found at one place and followed from there both ways, with the bend that grows and with the coefficient
# that says how: below zero the curved walk grows gently out of the straight one, above it the robot jumps.

paths = ("springs.stiffness[0]", "legs.forward_offset")
found = transition_curve(robot, paths, (springs, offsets), Kind.PITCHFORK, second=robot.get(paths[1]))
(turning,) = found.curve.special
spring, offset = found.shown(turning.values)
print(f"{turning.kind.label} at {spring:.5f} N·mm/deg and {1e3 * offset:.4f} mm")
found

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), sharey=True, layout="constrained")
values = found.values * [1.0, 1e3]  # N·mm/deg and mm
coefficient = np.array([point.coefficient for point in found.curve.points], dtype=float)  # NaN where it changes
left.plot(*values.T, color="grey", linewidth=1)
for gentle, color, name in ((coefficient < 0.0, "C0", "bends gently"), (coefficient >= 0.0, "C3", "jumps")):
    left.plot(*values[gentle].T, "o", markersize=4, color=color, label=name)
    right.plot(coefficient[gentle], values[gentle, 1], "o", markersize=4, color=color)
for axes, place in ((left, spring), (right, 0.0)):
    axes.plot(place, 1e3 * offset, "D", color="black", label="where it changes")
left.set(xlabel="first spring $k_1$ (N·mm/deg)", ylabel="feet ahead of the module's centre (mm)", title="the pitchfork")
left.text(9.3, 42.0, "softer: bends")
left.text(11.6, 25.0, "stiffer: walks straight")
left.legend(loc="upper left")
right.axvline(0.0, color="grey", linestyle="--", linewidth=1)
right.set(xlabel="cubic coefficient of the normal form", title="gently, or by a jump")
plt.show()
