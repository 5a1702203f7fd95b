"""
An engine of your own
=====================

An engine starts walks; everything else, controllers, studies, courses, asks no more of it than a small contract. The
smallest engine worth having changes one thing of another one: here the right feet are worn, and hold the floor less.
"""

from dataclasses import dataclass
from typing import ClassVar

import matplotlib.pyplot as plt
import numpy as np

from chilopod import load_robot, planar
from chilopod.engine import Traits, check_engine, steer
from chilopod.engine.arguments import as_robots
from chilopod.trials import mean_joint_angles


@dataclass(frozen=True)
class Worn:
    """The planar model with right feet that grip less."""

    grip: float = 0.5
    traits: ClassVar[Traits] = Traits(name="worn", sentence="the planar model with right feet that grip less")
    common = staticmethod(planar.common)
    initial_states = staticmethod(planar.initial_states)

    def start(self, robots, *, friction=None, **conditions):
        """As ``planar.start``; ``friction`` is a factor on that of every foot, left and right of each module."""
        robots = as_robots(robots)
        feet = self.feet(robots[0])
        friction = feet if friction is None else friction * feet
        return WornWalk(planar.start(robots, friction=friction, **conditions), feet)

    def resume(self, saved):
        """Go on with a walk that was put aside."""
        walk = planar.resume(saved)
        return WornWalk(walk, self.feet(walk.robots[0]))

    def feet(self, robot):
        """The factor that is theirs."""
        return np.tile([1.0, self.grip], (robot.body.modules, 1))


class WornWalk:
    """A walk of the planar model but for what is told it of feet, and for whose its record is."""

    def __init__(self, walk, feet):
        self.walk, self.feet = walk, feet

    def __getattr__(self, name):
        return getattr(self.walk, name)

    def restart(self, which, initial, friction=None, seeds=None):
        self.walk.restart(which, initial, None if friction is None else friction * self.feet, seeds)

    def to_dataset(self):
        return self.walk.to_dataset().assign_attrs(engine=Worn.traits.name)


# %%
# Does it keep what engines promise? The check tries every promise in short walks, and names the first that is broken.

robot = load_robot("aoi2022-planar")
worn = Worn()
kept = check_engine(worn, robot)
print(f"{len(kept)} promises kept, such as: {kept[0]}")

# %%
# The straight walk is as straight as ever, since a foot that rests on the floor needs no grip. But where good feet turn
# alike to both sides, worn ones do not.

soft = robot.override("springs.stiffness[0]", "9 N*mm/deg")
bent = np.concatenate([planar.initial_states(soft, joint_angles=side * np.radians(2.0)) for side in (-1.0, 1.0)])

figure, axes = plt.subplots(figsize=(6, 6), layout="constrained")
for name, engine, look in (("good feet", planar, "C0-"), ("worn feet", worn, "C1--")):
    walk = engine.start([soft, soft], initial=bent)
    steer(walk, 90.0)
    record = walk.to_dataset()
    left, right = soft.axis_radius(mean_joint_angles(record).transpose("robot", "joint").values)
    print(f"{name}: radius {left:.3f} m to the left, {right:.3f} m to the right")
    axes.plot(*record.position.transpose("axis", "time", "robot").values, look, label=[name, "_"])
axes.set(xlabel="x (m)", ylabel="y (m)", title="paths of the front module", aspect="equal")
axes.legend()
plt.show()
