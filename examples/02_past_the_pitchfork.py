"""
Past the pitchfork
==================

With a first spring of 8 N·mm/deg, softer than that of the pitchfork, the straight walk cannot last: whatever happens to
be a little off grows into a bend. The robot then walks a circle, to the left or to the right.
"""

import matplotlib.pyplot as plt

from chilopod import load_robot, units
from chilopod.analysis import curved_walks
from chilopod.tasks import walk

plt.style.use("tableau-colorblind10")

spring = "springs.stiffness[0]"
robot = load_robot("aoi2022-planar").override(spring, "8 N*mm/deg")

# %%
# Two minutes of walking, four times. Each seed stands for a floor and a start that are a little different.

walks = walk(robot, 120.0, seed=1, repeats=4, rate=10.0)
walks

# %%
# The theory says how tight the circle is: the **branch** of curved walks begins at the pitchfork, and each of its
# points is a periodic walk, stable or not. Its last point here is the walk with our spring.

soft, stiff = (units.parse(text, "N*m/rad") for text in ("8 N*mm/deg", "20 N*mm/deg"))
branch = curved_walks(robot, spring, (soft, stiff), points=30)
settled = branch.isel(point=-1)
ends = [each.axis_radius for each in walks.summaries]
print(f"radius of the branch: {settled.axis_radius.item():.4f} m, stable: {settled.stable.item()}")
print("radius of the walks: ", ", ".join(f"{radius:.4f} m" for radius in ends))

# %%
# The walks settle on the branch, to either side. Their feet differ, so their radii do, by a percent or two.

record = walks.record
angles = record.joint_angle.transpose("robot", "time", "joint").values
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for seed, place, bent in zip(
    (1, 2, 3, 4), record.position.transpose("robot", "time", "axis").values, angles, strict=True
):
    left.plot(*place.T, label=f"seed {seed}")
    right.semilogy(record.time, robot.axis_radius(bent))
left.set(xlabel="x (m)", ylabel="y (m)", title="path of the front module", aspect="equal")
left.legend()
right.axhline(settled.axis_radius.item(), color="black", linestyle="--", label="the branch")
right.set(xlabel="time (s)", ylabel="radius of the body axis (m)", title="how tightly it bends", ylim=(0.2, 30.0))
right.legend()
plt.show()
