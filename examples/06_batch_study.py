"""
A batch study with error bars
=============================

How surely, and how far, does a robot bend within a minute as its first spring is softened? Twenty walks for each of
six springs, every one a little disturbed, and intervals that say how well that is known.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import binomtest

from chilopod import load_robot
from chilopod.trials import Trial, run, summaries, together

robot = load_robot("aoi2022-planar")
springs = np.arange(8.0, 13.5, 1.0)  # N·mm/deg
REPEATS, DURATION = 20, 60.0  # walks of a spring, s

# %%
# A **trial** is everything that makes a walk: the same trial gives the same record, to the bit. All of them walk on all
# cores. With ``folder="trials"`` they would be kept, and a study that was stopped would go on where it was.

softened = [robot.override("springs.stiffness[0]", f"{spring} N*mm/deg") for spring in springs]
trials = [Trial(each, DURATION, seed, rate=2.0) for each in softened for seed in range(REPEATS)]
record = together(run(trials))
bends = np.array([np.abs(end.joint_angles_deg[0]) for end in summaries(robot, record)]).reshape(-1, REPEATS)

# %%
# Of how many walks bend, the interval is Wilson's, which holds near none and all of them; of how far they bend, the
# mean has its standard error.

bent = (bends > 10.0).sum(axis=1)
share = bent / REPEATS
interval = np.array([binomtest(int(count), REPEATS).proportion_ci(method="wilson") for count in bent])
mean, error = bends.mean(axis=1), bends.std(axis=1, ddof=1) / np.sqrt(REPEATS)
for row in zip(springs, bent, mean, error, strict=True):
    print("{:4.0f} N·mm/deg: {:2d} of 20 walks bend, by {:5.2f} ± {:.2f} deg".format(*row))

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
left.errorbar(springs, share, np.abs(interval.T - share), fmt="o", capsize=3)
left.set(xlabel="first spring $k_1$ (N·mm/deg)", ylabel="share of walks", title="walks that bend by more than 10°")
right.errorbar(springs, mean, error, fmt="o", capsize=3)
right.set(xlabel="first spring $k_1$ (N·mm/deg)", ylabel="bend of the first joint (deg)", title="mean ± standard error")
plt.show()
