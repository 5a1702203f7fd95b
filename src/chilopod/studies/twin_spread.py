"""How far to trust the twin's predictions: the same predictions by other sets of constants that fit as well.

``twin_fits.json`` holds what ``chilopod identify twin`` found: the sets of constants that meet the base series within
its tolerance. Those that differ most from each other predict what the paper prints of other experiments, each with few
and undisturbed walks.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod import trials
from chilopod.analysis.parameters import K1, stiffness
from chilopod.analysis.square_root import square_root_fit
from chilopod.engine import Status
from chilopod.errors import AnalysisError
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.steering import ARRIVAL_RADIUS, Target, steered, strategy_named
from chilopod.studies.curved_trials import variant_robots
from chilopod.studies.paper import printed
from chilopod.studies.robot_walks import undulations
from chilopod.tasks.identify.twin import known, unlike
from chilopod.tasks.identify.twin_constants import FREE, with_constants
from chilopod.tasks.radius_law import CURVED
from chilopod.trials import AVERAGED, NONE, Trial

Array = NDArray[np.float64]

SPRINGS = (13.0, 15.0, 17.0, 19.0, 21.0, 24.0, 28.0)
"""k1 of the variants, N*mm/deg."""

TASK_SPRINGS = (15.0, 17.0, 21.0, 26.0, 28.0, 34.0, 41.0)
UNIFORM_SPRINGS = (8.7, 11.0, 13.0, 15.0)
COUNT = 4
"""Sets of constants that predict, the preset's among them."""

_DURATION, _TASK = 45.0, 23.0  # s
_BEND = float(np.deg2rad(5.0))


def twin_spread(
    robot: Robot, folder: str | Path | None = None, count: int = COUNT, progress: Progress = silent
) -> xr.Dataset:
    """Predictions by several sets of constants.

    Parameters
    ----------
    robot
        For what is not fitted.
    folder
        Where trials are kept.
    count
        Of sets.
    progress
        Called as the work goes on.

    Returns
    -------
    Dataset over set (0 the preset's): the constants (SI) by path over ``constant``, ``misfit``, and predictions:
    ``onset`` over variant (N*mm/deg, NaN where trials determine none), ``tighter`` over variant (bend at 15 N*mm/deg
    over that as built), ``uniform`` (N*mm/deg), and over task ``best``, the spring that comes nearest to the target
    (N*mm/deg), and ``arrives``, whether that arrives.
    """
    fits = unlike(known(), count)
    rows: list[dict[str, Any]] = []
    for index, fit in enumerate(fits):
        progress(index / len(fits), f"set {index + 1} of {len(fits)}")
        rows.append(predictions(with_constants(robot, fit.constants), folder))
    names = list(rows[0]["onset"])
    tasks = list(rows[0]["best"])
    data = xr.Dataset(
        {
            "constants": (("set", "constant"), np.array([fit.constants for fit in fits])),
            "misfit": ("set", np.array([fit.misfit for fit in fits])),
            "uniform": ("set", np.array([row["uniform"] for row in rows]), {"units": "N*mm/deg"}),
        },
        coords={"set": np.arange(len(fits)), "constant": [c.path for c in FREE], "variant": names, "task": tasks},
        attrs={"robot": robot.name, "known": len(known())},
    )
    for name, over, keys in (("onset", "variant", names), ("tighter", "variant", names), ("best", "task", tasks)):
        data[name] = (("set", over), np.array([[row[name][key] for key in keys] for row in rows]))
    data["arrives"] = (("set", "task"), np.array([[row["arrives"][task] for task in tasks] for row in rows]))
    return data


def predictions(robot: Robot, folder: str | Path | None = None) -> dict[str, Any]:
    """What a robot does where the paper prints what its robot did, other than in the base series."""
    found: dict[str, Any] = {"onset": {}, "tighter": {}, "best": {}, "arrives": {}}
    mode = np.array(printed()["pitchfork"]["joint_components"])
    bend = tuple(_BEND * mode / np.linalg.norm(mode)) if robot.body.modules - 1 == len(mode) else ()
    bends = {}
    for name, variant in variant_robots(robot).items():
        walks = [
            Trial(variant.with_value(K1, stiffness(k)), _DURATION, 0, bend, disturbance=NONE, rate=10.0, engine="twin")
            for k in SPRINGS
        ]
        angles = np.array([_mean_angles(record) for record in trials.run(walks, folder)])
        summed = np.abs(angles).sum(axis=1)
        curved = summed > CURVED
        bends[name] = summed[SPRINGS.index(15.0)]
        try:
            fit = square_root_fit(1.0 / np.array(SPRINGS)[curved], np.abs(angles[curved, 0]), resampled=0)
            found["onset"][name] = fit.critical
        except AnalysisError:
            found["onset"][name] = np.nan
    found["tighter"] = {name: float(value / bends["as built"]) for name, value in bends.items()}
    found["uniform"] = undulations(robot, UNIFORM_SPRINGS, 1, folder=folder).attrs["critical_k"]
    plan = strategy_named("pitchfork")
    for letter, entry in printed()["turning"]["tasks"].items():
        walks = []
        for k in TASK_SPRINGS:
            walker, controller = steered(robot, plan, stiffness(k))
            target = Target.parse(entry["target"])
            walks.append(Trial(walker, _TASK, 0, (), target, controller, disturbance=NONE, rate=20.0, engine="twin"))
        nearest = [float(record.distance.min()) for record in trials.run(walks, folder)]
        found["best"][letter] = TASK_SPRINGS[int(np.argmin(nearest))]
        found["arrives"][letter] = bool(min(nearest) < ARRIVAL_RADIUS)
    return found


def _mean_angles(record: xr.Dataset) -> Array:
    walk = record.isel(robot=0)
    if walk.status.item() != Status.WALKED.label:
        return np.zeros(walk.sizes["joint"])
    late = walk.time > walk.time[-1] - AVERAGED + 1e-9
    means: Array = walk.joint_angle.where(late, drop=True).mean("time").values
    return means
