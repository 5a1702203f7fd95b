"""Courses that nobody walked."""

import numpy as np
import xarray as xr

from chilopod.steering import ON_COURSES

SUMS = ("goal_path", "goal_shortest", "goal_effort", "goal_spring_work", "goal_drive_work")


def compared(courses=40, engine="planar", **changes):
    """Outcomes of all strategies, over (case, course, goal): the variable spring reaches all, the others every second
    target, each second as late; and the axis with torques does about ten times the work."""
    cases = list(ON_COURSES)
    shape = (len(cases), courses, 5)
    data = {name: np.ones(shape) for name in ("arrived", "seconds", *SUMS)}
    data["arrived"][1:, :, 1::2] = 0.0
    data["seconds"][:] = 10.0 + np.arange(courses)[:, None] % 7
    data["seconds"][1:] *= 2.0
    data["goal_spring_work"][1:] = data["goal_drive_work"][:] = 0.0
    data["goal_drive_work"][cases.index("actuated")] = 10.0 + np.resize([-1.0, 0.0, 1.0, 0.0], courses)[:, None]
    for name, change in changes.items():
        data[name] = change(data[name])
    rng = np.random.default_rng(0)
    over = ("case", "course", "goal")
    return xr.Dataset(
        {
            **{name: (over, values) for name, values in data.items()},
            "bearing": (over[1:], rng.uniform(-1.3, 1.3, shape[1:])),
            "away": (over[1:], rng.uniform(0.8, 2.0, shape[1:])),
            "spring": ("case", [np.nan, 15.0, 7.0, np.nan, np.nan]),
            "cost": ("case", [0.01, 0.0, 0.0, 0.0, 0.1]),
        },
        coords={"case": cases, "course": np.arange(courses), "goal": np.arange(1, 6)},
        attrs={"engine": engine, "patience_s": 40.0},
    )


def conditions(courses=40, worse=()):
    """Of the variable spring and one for all; the former reaches nothing under some conditions."""
    names = ["as usual", "one", "another"]
    arrived = np.ones((3, 2, courses, 5))
    arrived[:, 1, :, 0] = 0.0
    arrived[[names.index(name) for name in worse]] = 0.0
    return xr.Dataset(
        {"arrived": (("condition", "strategy", "course", "goal"), arrived)},
        coords={"condition": names, "strategy": ["variable", "pitchfork"], "course": np.arange(courses)},
        attrs={"engine": "planar", "spring": 15.0},
    )
