"""
A turn to a target
==================

The target is 1.3 m away, 45 degrees to the left: the paper's task A. The robot picks a spring whose curved walk leads
there, and its front legs, which yaw a little towards the target, choose the side.
"""

import matplotlib.pyplot as plt
import numpy as np

from chilopod import load_robot, units
from chilopod.steering import ARRIVAL_RADIUS, Target, strategy_named
from chilopod.tasks import turn

robot = load_robot("aoi2022-planar")
target = Target.parse("45 deg, 1.3 m")

done = turn(robot, target, strategy_named("pitchfork"))
done

# %%
# Why not the spring of the circle?
# ---------------------------------
# The radius law gives the spring of the circle through the target. But a bend takes time to grow, so that a robot that
# starts straight is not yet on its circle when it passes the target. A softer spring gets there.

by_law = turn(robot, target, strategy_named("pitchfork"), done.by_law)
for name, each in (("tried", done), ("by the law", by_law)):
    spring, nearest = units.from_si(each.stiffness, "N*mm/deg"), each.criteria.nearest[0]
    print(f"{name}: {spring:.2f} N·mm/deg, {each.criteria.outcome[0].label}, {nearest:.3f} m at its nearest")

# %%
figure, axes = plt.subplots(figsize=(6, 4.5), layout="constrained")
for each, style in ((done, "-"), (by_law, "--")):
    spring = units.from_si(each.stiffness, "N*mm/deg")
    axes.plot(
        *each.record.position.isel(robot=0).transpose("axis", "time").values, style, label=f"{spring:.1f} N·mm/deg"
    )
along = np.linspace(0.0, 2.0 * target.bearing, 100)
axes.plot(target.radius * np.sin(along), target.radius * (1.0 - np.cos(along)), ":", color="grey", label="the circle")
axes.add_patch(plt.Circle(target.position, ARRIVAL_RADIUS, color="C2", alpha=0.4))
axes.annotate("target", target.position, ha="center", va="center")
axes.set(xlabel="x (m)", ylabel="y (m)", title="path of the front module", aspect="equal")
axes.legend(loc="upper left")
plt.show()
