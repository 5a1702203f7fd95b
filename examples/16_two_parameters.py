"""
The pitchfork in two parameters
===============================

Where the straight walk gives way hangs on more than the spring. Here the pitchfork is followed as the feet move forward
under their modules, too; on the way it changes its nature.
"""

import matplotlib.pyplot as plt

from chilopod import load_robot
from chilopod.analysis import map

robot = load_robot("aoi2022-planar")

# %%
# The map computes growth rates on a grid, and continues the curve between them exactly, with the coefficient that says
# how the walk bends: below zero the curved walk grows gently out of the straight one, above it the robot jumps.

springs = ("springs.stiffness[0]", "7 N*mm/deg", "16 N*mm/deg")
offsets = ("legs.forward_offset", "1 cm", "7 cm")
found = map(robot, springs, offsets, points=25)
(curve,), (turning,) = found.curves, found.special
spring, offset = found.x.shown(turning.values)[0], turning.values[1]
print(f"{turning.kind.label} at {spring:.5f} N·mm/deg and {1e3 * offset:.4f} mm")
found

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), sharey=True, layout="constrained")
stiffness, ahead = found.x.shown(curve.values[:, 0]), 1e3 * curve.values[:, 1]  # N·mm/deg and mm
left.plot(stiffness, ahead, color="grey", linewidth=1)
for gentle, color, name in ((curve.coefficient < 0.0, "C0", "bends gently"), (curve.coefficient >= 0.0, "C3", "jumps")):
    left.plot(stiffness[gentle], ahead[gentle], "o", markersize=4, color=color, label=name)
    right.plot(curve.coefficient[gentle], ahead[gentle], "o", markersize=4, color=color)
for axes, place in ((left, spring), (right, 0.0)):
    axes.plot(place, 1e3 * offset, "D", color="black", label="where it changes")
left.set(xlabel="first spring $k_1$ (N·mm/deg)", ylabel="feet ahead of the module's centre (mm)", title="the pitchfork")
left.text(9.3, 42.0, "softer: bends")
left.text(11.6, 25.0, "stiffer: walks straight")
left.legend(loc="upper left")
right.axvline(0.0, color="grey", linestyle="--", linewidth=1)
right.set(xlabel="cubic coefficient of the normal form", title="gently, or by a jump")
plt.show()
