"""
A robot of your own, with twenty modules
========================================

A robot is a text file in which every quantity carries its unit. This one has twenty modules, and all its springs are
alike. Which of them have to be how soft for it to bend?
"""

import matplotlib.pyplot as plt
import numpy as np

from chilopod import Robot, units
from chilopod.analysis import bifurcations, straight_walk

plt.style.use("tableau-colorblind10")

robot = Robot.from_toml("""
name = "twenty"

[body]
modules = 20
length = "4.5 m"
mass = "28 kg"

[springs]  # one value stands for all
stiffness = "41 N*mm/deg"
damping = "0 N*m*s/rad"

[legs]  # where a foot is in the middle of its stroke
forward_offset = "49.3 mm"
half_width = "73.2 mm"

[gait]
stride = "3 cm"
stance = "0.31 s"
swing = "0.29 s"
module_phase = "36 deg"
side_phase = "180 deg"

[ground]
friction = "246.5 N*s/m"
""")
robot

# %%
# Soften the first spring alone, and the robot bends at a pitchfork, as the short one does. ``[0]`` is that spring; the
# path without a number stands for all springs together.

between = tuple(units.parse(text, "N*m/rad") for text in ("9 N*mm/deg", "60 N*mm/deg"))
(first,) = bifurcations(robot, "springs.stiffness[0]", between)
*_, together = bifurcations(robot, "springs.stiffness", between)
for name, point in (("first spring", first), ("all springs", together)):
    print(f"{name}: {point.point.kind.label} at {point.value:.6f} N·mm/deg")
together

# %%
# Soften all of them together, and it is a wave that grows, one that travels along the body: two multipliers leave the
# unit circle as a pair. Any number of the file can be set by its path.

soft = straight_walk(robot.set_from_text(["springs.stiffness = 9 N*mm/deg"]))
values = soft.exponents.multipliers.values
print(f"at 9 N·mm/deg {(np.abs(values) > 1.0).sum()} of {len(values)} multipliers are outside")

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), width_ratios=[1, 1.5], layout="constrained")
left.add_patch(plt.Circle((0.0, 0.0), 1.0, fill=False, color="grey"))
left.plot(values.real, values.imag, "o", markersize=4)
left.set(xlabel="real part", ylabel="imaginary part", aspect="equal", xlim=(0.55, 1.1), ylim=(-0.4, 0.4))
left.set_title("largest multipliers, all springs 9 N·mm/deg", fontsize="medium")
joints = np.arange(1, robot.body.modules)
right.plot(joints, first.joint_components.real, "o-", label="first spring: the bend")
for phase in (0.0, 0.25):
    wave = (together.joint_components * np.exp(2j * np.pi * phase)).real
    right.plot(
        joints, wave, ".--", label=f"all springs: the wave, {'now' if phase == 0 else 'a quarter of its period on'}"
    )
right.set(
    xlabel="joint, front to rear", ylabel="joint angle (of a mode of size 1)", title="what grows", ylim=(-0.8, 0.5)
)
right.set_xticks(joints[::3])
right.legend(fontsize="small")
plt.show()
