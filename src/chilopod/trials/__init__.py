"""Trials: one walk each, with its conditions, its disturbances drawn from a seed, and its file.

A study is a list of trials. They run in batches on all cores, or on a cluster, each batch's records are written as soon
as it is done, every file whole or not at all and under a name derived from all that makes the trial, so a study that
was stopped in any way goes on where it was, and a trial that several studies share is run once.
"""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.trials.batch import batches, walked
    from chilopod.trials.cluster import Cluster
    from chilopod.trials.disturbance import NONE, Disturbance, Drawn, draw
    from chilopod.trials.executors import Executor, Here, using
    from chilopod.trials.run import as_now, check_fits, run, run_each, together
    from chilopod.trials.store import Store
    from chilopod.trials.summary import AVERAGED, WalkSummary, finite, mean_joint_angles, straight, summaries
    from chilopod.trials.trial import Trial
else:
    __getattr__, __dir__ = exports(
        __name__,
        {
            "batch": ("batches", "walked"),
            "cluster": ("Cluster",),
            "disturbance": ("NONE", "Disturbance", "Drawn", "draw"),
            "executors": ("Executor", "Here", "using"),
            "run": ("as_now", "check_fits", "run", "run_each", "together"),
            "store": ("Store",),
            "summary": ("AVERAGED", "WalkSummary", "finite", "mean_joint_angles", "straight", "summaries"),
            "trial": ("Trial",),
        },
    )

__all__ = [
    "AVERAGED",
    "NONE",
    "Cluster",
    "Disturbance",
    "Drawn",
    "Executor",
    "Here",
    "Store",
    "Trial",
    "WalkSummary",
    "as_now",
    "batches",
    "check_fits",
    "draw",
    "finite",
    "mean_joint_angles",
    "run",
    "run_each",
    "straight",
    "summaries",
    "together",
    "using",
    "walked",
]
