"""
A spring sets the radius
========================

Every spring softer than that of the pitchfork has its own circle. Followed from the pitchfork on, the curved walks form
a **branch**: it says which spring turns the robot how tightly, what the turn costs, and whether it lasts.
"""

import matplotlib.pyplot as plt
import numpy as np

from chilopod import load_robot, units
from chilopod.analysis import curved_walks

robot = load_robot("aoi2022-planar")
interval = tuple(units.parse(text, "N*m/rad") for text in ("7.5 N*mm/deg", "20 N*mm/deg"))

branch = curved_walks(robot, "springs.stiffness[0]", interval, points=25)
branch

# %%
# Gently, or by a jump?
# ---------------------
# That hangs on where the feet are. With the feet nearer the middle of the modules the branch leaves the pitchfork
# towards *stiffer* springs, unstable, and turns back in a fold: such a robot, softened ever so slowly, jumps to its
# circle.

nearer = robot.override("legs.forward_offset", "20 mm")
jumping = curved_walks(nearer, "springs.stiffness[0]", interval, points=25)
for name, walks in (("feet as they are", branch), ("feet nearer", jumping)):
    print(f"{name}: {walks.criticality}, pitchfork at {walks.parameter.values[0]:.4f} N·mm/deg")
fold = jumping.parameter.values[jumping.special.values == "fold"].item()
print(f"fold at {fold:.4f} N·mm/deg")

# %%
# Curvature is one over the radius; solid lines are walks that last, dotted ones those that do not.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for walks, color, name in ((branch, "C0", "feet as they are"), (jumping, "C1", "feet nearer")):
    spring, curvature = walks.parameter.values, 1.0 / walks.path_radius.values
    lasts = walks.stable.values | (walks.special.values == "fold")
    left.plot(spring, curvature, ":", color=color)
    left.plot(spring, np.where(lasts, curvature, np.nan), color=color, label=name)
    left.plot(spring[0], 0.0, "o", color=color)
    right.plot(walks.path_radius, walks.speed, color=color)
left.set(xlabel="first spring $k_1$ (N·mm/deg)", ylabel="curvature of the path (1/m)", title="softer is tighter")
left.legend()
right.set(xlabel="radius of the path (m)", ylabel="speed (m/s)", title="tighter is slower", xlim=(0.0, 2.0))
plt.show()
