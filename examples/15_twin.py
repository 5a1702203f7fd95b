"""
The whole robot, in three dimensions
====================================

The twin has what the planar model leaves out: bodies with a height, legs with servos that lift their feet, a floor with
dry friction, a laser scanner that looks for the target. Its spring of 21 N·mm/deg is the one that led the paper's robot
to the same target.
"""

import matplotlib.pyplot as plt
import mujoco
import numpy as np

from chilopod import load_robot, units
from chilopod.show import replay
from chilopod.steering import ARRIVAL_RADIUS, Target, strategy_named
from chilopod.tasks import turn
from chilopod.twin import TwinModel

robot = load_robot("aoi2022")
target = Target.parse("45 deg, 1.3 m")
spring = units.parse("21 N*mm/deg", "N*m/rad")

done = turn(robot, target, strategy_named("pitchfork"), spring, duration=24.0, seed=1, engine="twin")
print(f"{done.criteria.outcome[0].label} after {done.criteria.arrival[0]:.1f} s; the paper's robot took 23 s at least")
done

# %%
# The walk plays where it is: drag to turn it, wheel to zoom.

replay(done.record)

# %%
# The record has the positions of all joints, so MuJoCo can put the bodies where they were.

model = TwinModel(done.robot).model
data = mujoco.MjData(model)


def drawn(axes, pose):
    """Draw modules and links as lines along their longest sides."""
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    turned = data.geom_xmat.reshape(-1, 3, 3)
    for kind, axis, look in (
        (mujoco.mjtGeom.mjGEOM_BOX, 0, {"color": "C0", "linewidth": 5}),
        (mujoco.mjtGeom.mjGEOM_CAPSULE, 2, {"color": "C7", "linewidth": 2}),
    ):
        for geom in np.flatnonzero(model.geom_type == kind):
            half = model.geom_size[geom, 0 if axis == 0 else 1] * turned[geom, :, axis]
            axes.plot(*np.array([data.geom_xpos[geom] - half, data.geom_xpos[geom] + half]).T, **look)


# %%
record = done.record.isel(robot=0)
figure, axes = plt.subplots(figsize=(8, 4.5), subplot_kw={"projection": "3d"})
for time in (0.0, 20.0):
    drawn(axes, record.pose.sel(time=time).values)
axes.plot(*record.position.transpose("axis", "time").values, 0.0, color="C1", label="path of the front module")
around = np.linspace(0.0, 2.0 * np.pi, 60)
circle = target.position[:, None] + ARRIVAL_RADIUS * np.array([np.cos(around), np.sin(around)])
axes.plot(*circle, 0.0, color="C2", label="target")
axes.set(xlabel="x (m)", ylabel="y (m)", zlabel="z (m)", title="the robot at 0 and at 20 s")
axes.set(xlim=(-1.3, 1.2), ylim=(-0.2, 1.2), zlim=(0.0, 0.3), zticks=[0.0, 0.2])
axes.set_box_aspect((2.5, 1.4, 0.3), zoom=1.4)
axes.view_init(elev=35, azim=-70)
axes.legend(loc="upper left")
plt.show()
