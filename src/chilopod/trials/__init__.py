"""Trials: single walks with conditions, disturbances drawn from a seed, and a file each.

A study is a list of trials. They run in batches on all cores, or on a cluster. The records of each batch are written as
soon as it is done, in complete files whose names are derived from everything that defines the trial. Therefore a
stopped study resumes where it was, and a trial that several studies share runs once.
"""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.trials.batch import Executor, Here, batches, using, walked
    from chilopod.trials.cluster import Cluster
    from chilopod.trials.run import as_now, check_fits, run, run_each, together
    from chilopod.trials.store import Store
    from chilopod.trials.summary import AVERAGED, WalkSummary, mean_joint_angles, straight, summaries
    from chilopod.trials.trial import NONE, Disturbance, Drawn, Trial, draw
else:
    __getattr__, __dir__ = exports(
        __name__,
        {
            "batch": ("Executor", "Here", "batches", "using", "walked"),
            "cluster": ("Cluster",),
            "run": ("as_now", "check_fits", "run", "run_each", "together"),
            "store": ("Store",),
            "summary": ("AVERAGED", "WalkSummary", "mean_joint_angles", "straight", "summaries"),
            "trial": ("NONE", "Disturbance", "Drawn", "Trial", "draw"),
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
    "mean_joint_angles",
    "run",
    "run_each",
    "straight",
    "summaries",
    "together",
    "using",
    "walked",
]
