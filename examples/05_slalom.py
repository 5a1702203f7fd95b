"""
A slalom with one spring
========================

One spring makes one turn; the next turn wants another, and the way between them a stiff one. Here an actuator sets the
first spring anew in every gait cycle: soft to turn, stiff to go straight.
"""

import matplotlib.pyplot as plt

from chilopod import load_robot, units
from chilopod.steering import ARRIVAL_RADIUS, VARIABLE, course_named
from chilopod.tasks import drive, driver

ready = driver(load_robot("aoi2022-planar"), VARIABLE)  # finds how tightly which spring turns, and what steers
slalom = course_named("1.5 m, 0.5 m; 3 m, -0.5 m; 4.5 m, 0.5 m", patience=40.0)  # three gates, x and y

done = drive(ready, slalom, seed=1)
done

# %%
# The referee, who knows where the robot is, puts up one gate after the other; the robot sees only the direction and the
# distance of the gate that stands.

record = done.record.isel(robot=0)
for gate, verdict, end in zip(record.goal.values, record.goal_verdict.values, record.goal_end.values, strict=True):
    print(f"gate {gate}: {verdict} after {end:.1f} s")

# %%
figure, (top, bottom) = plt.subplots(2, 1, figsize=(8, 6), height_ratios=[1.6, 1], layout="constrained")
top.plot(*record.position.transpose("axis", "time").values)
for place in record.goal_place.transpose("goal", "axis").values:
    top.add_patch(plt.Circle(place, ARRIVAL_RADIUS, color="C2", alpha=0.4))
top.set(xlabel="x (m)", ylabel="y (m)", title="path of the front module", aspect="equal")
bottom.plot(record.time, units.from_si(1.0, "N*mm/deg") * record.stiffness.isel(joint=0), linewidth=1)
bottom.axhline(units.from_si(done.pitchfork, "N*mm/deg"), color="black", linestyle="--", label="pitchfork")
bottom.set(xlabel="time (s)", ylabel="$k_1$ (N·mm/deg)", title="the first spring", ylim=(0.0, None))
bottom.legend()
plt.show()
