"""
A controller of your own
========================

A controller is asked at moments of the gait that it chooses. It sees what the robot's sensors give, and answers with a
command. This one looks at nothing but the clock: soft springs bend the robot, and a nudge by the front legs, now to the
left and now to the right, tells it to which side.
"""

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np

from chilopod import load_robot
from chilopod.engine import Command, Event
from chilopod.planar import simulate

plt.style.use("tableau-colorblind10")


@dataclass(frozen=True)
class Serpentine:
    """The front legs yaw to one side and to the other, each for half of the time between two waves."""

    yaw: float = np.radians(5.0)
    every: float = 60.0  # s

    def events(self, gait):
        """Once in a gait cycle, with a tenth of a second to act."""
        return [Event("once a cycle", phase=0.0, window=0.1)]

    def act(self, event, seen):
        """Both legs of the front module to one side; a row stands for each robot of the batch."""
        side = 1.0 if seen.time % self.every < 0.5 * self.every else -1.0
        return Command(leg_yaw=np.full_like(seen.leg_yaw, side * self.yaw), within=event.window)


# %%
# Three robots at once, alike but for the first spring, walk for three minutes.

springs = (15, 20, 41)  # N·mm/deg
robots = [load_robot("aoi2022-planar").override("springs.stiffness[0]", f"{spring} N*mm/deg") for spring in springs]
record = simulate(robots, 180.0, controller=Serpentine())

# %%
# What the legs do is the same; the softer the spring, the more the body makes of it.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
bend = np.rad2deg(record.joint_angle.sum("joint"))
for index, spring in enumerate(springs):
    left.plot(*record.position.isel(robot=index).transpose("axis", "time").values, label=f"$k_1$ = {spring} N·mm/deg")
    right.plot(record.time, bend.isel(robot=index))
left.set(xlabel="x (m)", ylabel="y (m)", title="path of the front module", aspect="equal")
left.legend()
right.set(xlabel="time (s)", ylabel="all joints together (deg)", title="bend of the body")
plt.show()
