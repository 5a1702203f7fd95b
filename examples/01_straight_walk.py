"""
The straight walk gives way
===========================

A robot of six modules walks straight as long as the first spring of its body axis is stiff. Soften that spring, and a
small bend no longer dies out: the straight walk has lost its stability. When, and how, is what Floquet theory says.
"""

import matplotlib.pyplot as plt
import numpy as np

from chilopod import load_robot
from chilopod.analysis import pitchfork, straight_walk

plt.style.use("tableau-colorblind10")

robot = load_robot("aoi2022-planar")
robot

# %%
# Stable, or not?
# ---------------
# A **multiplier** says by what a small disturbance has grown after one period of the gait. There is one for each of the
# 13 states of the robot. The walk is stable if all of them are less than 1 in size.

for spring in ("15 N*mm/deg", "10 N*mm/deg"):
    walk = straight_walk(robot.override("springs.stiffness[0]", spring))
    print(f"{spring}: largest multiplier {walk.moduli.max():.4f}, stable: {walk.stable}")

# %%
# Where does it change?
# ---------------------
# ``pitchfork`` locates the point, with a bound on its error, and says what happens there. The paper has 12 N·mm/deg.

point = pitchfork(robot)
print(f"{point.value:.6f} ± {point.error_bound:.0e} N·mm/deg")
point

# %%
# The whole picture: the three largest multipliers over the spring. One of them leaves the unit circle.

springs = np.linspace(6.0, 30.0, 33)  # N·mm/deg
largest = [straight_walk(robot.override("springs.stiffness[0]", f"{spring} N*mm/deg")).moduli[:3] for spring in springs]

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), width_ratios=[1.7, 1], layout="constrained")
left.plot(springs, largest)
left.axhline(1.0, color="grey", linestyle="--", linewidth=1)
left.plot(point.value, 1.0, "o", color="black")
left.annotate(f"pitchfork at {point.value:.4f}", (point.value, 1.0), (10, 10), textcoords="offset points")
left.set(xlabel="first spring $k_1$ (N·mm/deg)", ylabel="size of the multiplier")
left.set_title("by what a disturbance grows in one period")

joints = np.arange(1, robot.body.modules)
right.bar(joints, point.joint_components.real, color="C0")
right.set(xlabel="joint, front to rear", ylabel="joint angle (of a bend of size 1)", title="the bend that grows")
plt.show()
