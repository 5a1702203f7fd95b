"""
A policy that is searched for
=============================

The robot as an environment of `Gymnasium <https://gymnasium.farama.org>`_: once a gait cycle a *policy* is shown what
the sensors give, and answers with the stiffness of the first spring and the yaw of the legs of module 1. Here a policy
of four numbers is searched for with CMA-ES, a search that needs no gradients, and held against the paper's leg-yaw
controller on random targets that the search has never seen.
"""

import sys
import time

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
from cmaes import CMA

from chilopod.gym import baseline

plt.style.use("tableau-colorblind10")

TURN = "chilopod.gym:chilopod/Turn-v0"

# %%
# Two budgets: what the gallery spends, and what is worth spending, ``python 14_policy_search.py full``.
if sys.argv[1:] == ["full"]:
    GENERATIONS, POLICIES, TARGETS, HELD_OUT = 16, 10, 16, 400
else:
    GENERATIONS, POLICIES, TARGETS, HELD_OUT = 5, 8, 6, 60

# %%
# The policy
# ----------
# A positive bearing is to the left. Where the target is not in view, it is taken to be far to the side that the legs
# are turned to. The body axis *bends towards* the target by the sum of its joints, to the side of the bearing. From
# that the first spring is set, soft (-1) to bend further and stiff (+1) to straighten. Both legs yaw to the target.


def act(seen: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Actions for observations, shape (robots, 12); weights of shape (4,) or (robots, 4)."""
    bearing = np.where(seen[:, 0] > 0.5, np.arctan2(seen[:, 1], seen[:, 2]), np.copysign(np.pi / 2, seen[:, 9]))
    bend = -np.sign(bearing) * seen[:, 4:9].sum(axis=1)
    level, turn, straighten, gain = np.moveaxis(np.asarray(weights), -1, 0)
    spring = np.tanh(level - turn * np.abs(bearing) + straighten * bend)
    yaw = np.tanh(gain * bearing)
    return np.column_stack([spring, yaw, yaw]).astype(np.float32)


# %%
# An episode
# ----------
# All robots walk at the same time, in one vector environment. Those whose episode is over begin another; only the first
# episode of each counts.


def episodes(policy, seeds):
    """Return, and time to the target in s (NaN: not reached), of the episodes of some seeds."""
    env = gymnasium.make_vec(TURN, num_envs=len(seeds))
    chosen = policy(env.unwrapped.episodes)
    seen, _ = env.reset(seed=[int(seed) for seed in seeds])
    going, total, when = np.ones(len(seeds), dtype=bool), np.zeros(len(seeds)), np.full(len(seeds), np.nan)
    while going.any():
        seen, reward, terminated, truncated, info = env.step(chosen(seen))
        total[going] += reward[going]
        there = going & (info["verdict"] == "arrived")
        when[there] = info["time"][there]
        going &= ~(terminated | truncated)
    return total, when


# %%
# The search
# ----------
# Every policy of a generation walks to the same targets, and every generation to others. One batch holds them all.
search = CMA(mean=np.zeros(4), sigma=1.0, seed=1, population_size=POLICIES)
begun, progress = time.perf_counter(), []
for generation in range(GENERATIONS):
    policies = np.array([search.ask() for _ in range(POLICIES)])
    weights = np.repeat(policies, TARGETS, axis=0)
    seeds = np.tile(10_000 + generation * TARGETS + np.arange(TARGETS), POLICIES)
    total, _ = episodes(lambda _, weights=weights: lambda seen: act(seen, weights), seeds)
    returns = total.reshape(POLICIES, TARGETS).mean(axis=1)
    search.tell([(policy, -value) for policy, value in zip(policies, returns, strict=True)])
    progress.append(returns)
found = search.mean
print(f"{time.perf_counter() - begun:.0f} s for {GENERATIONS} generations; weights {np.round(found, 2)}")

# %%
# Held out
# --------
# The same targets for everybody, and none of them was in the search. Shares of arrivals have Wilson's 95 % intervals.
seeds = np.arange(HELD_OUT)
walked = {
    "found": episodes(lambda _: lambda seen: act(seen, found), seeds),
    "leg-yaw": episodes(lambda env: baseline("leg-yaw", env), seeds),
    "variable": episodes(lambda env: baseline("variable", env), seeds),
}


def interval(hits: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Wilson's interval of a share."""
    share = hits / count
    middle, half = share + z**2 / (2 * count), z * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2))
    return (middle - half) / (1 + z**2 / count), (middle + half) / (1 + z**2 / count)


for name, (total, when) in walked.items():
    hits = int(np.isfinite(when).sum())
    low, high = interval(hits, HELD_OUT)
    error = total.std(ddof=1) / np.sqrt(HELD_OUT)
    print(
        f"{name:9s} arrives at {hits} of {HELD_OUT} targets ({low:.0%} to {high:.0%}) "
        f"in {np.nanmean(when):.1f} s; return {total.mean():.2f} ± {error:.2f}"
    )
gained = walked["found"][0] - walked["leg-yaw"][0]
better, error = gained.mean(), 1.96 * gained.std(ddof=1) / np.sqrt(HELD_OUT)
print(f"return gained over leg-yaw, target by target: {better:.2f} ± {error:.2f} (95 %)")

# %%
# With the spring to set, few numbers do what leg yaw alone cannot: it is too wide for near targets aside.
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
left.plot([each.max() for each in progress], "o-", label="best of the generation")
left.plot([each.mean() for each in progress], "o-", label="mean")
left.axhline(walked["leg-yaw"][0].mean(), color="0.5", ls="--", label="leg-yaw")
left.set(xlabel="generation", ylabel="mean return", title="The search")
left.legend(frameon=False)
for name, (_, when) in walked.items():
    right.step([0, *np.sort(when[np.isfinite(when)])], np.arange(np.isfinite(when).sum() + 1) / HELD_OUT, label=name)
right.set(xlabel="time, s", ylabel="share that has arrived", title="On targets that were held out", ylim=(0, 1))
right.legend(frameon=False)
plt.show()
