"""What the whole robot's studies find, without any simulation: bends that follow a square root, criteria that follow a
parabola, so that the answers are known."""

import dataclasses
from functools import cache

import numpy as np
import xarray as xr

from chilopod import load_robot
from chilopod.paper.robot.turning import RobotTurning
from chilopod.paper.robot.walks import BEND, SHORTER, SPRINGS, UNDULATION, VARIANT_SPRINGS, RobotWalks, over_durations
from chilopod.paper.turning.trials import CRITERIA, TurningTask
from chilopod.steering import Outcome, Target

ROBOT = load_robot("aoi2022")
AMPLITUDE = 9.7
"""rad, of a robot that meets both printed radii with its onset at 34 N*mm/deg."""

_MODE = np.array([0.64, 0.36, 0.48, 0.46, 0.16]) / 2.10
_LENGTH = 5 * ROBOT.module_length


def series(springs, onset, amplitude=AMPLITUDE, *, repeats=10, scatter=0.01, saturation=np.inf, speed=0.056, seed=0):
    """Trials with a bend of amplitude * sqrt(d / (1 + d / saturation)), d = 1/k1 - 1/onset, give or take ``scatter``.

    Every second one turns left; springs stiffer than the onset walk straight.
    """
    rng = np.random.default_rng(seed)
    springs = np.asarray(springs, float)
    away = np.maximum(1.0 / springs - 1.0 / onset, 0.0)
    bend = amplitude * np.sqrt(away / (1.0 + away / saturation))
    noise = rng.standard_normal((len(springs), repeats))
    noise = (noise - noise.mean(axis=1, keepdims=True)) / noise.std(axis=1, ddof=1, keepdims=True)
    bends = bend[:, None] * (1.0 + scatter * noise) + 1e-3
    straight = bends < 0.25
    side = np.where(np.arange(repeats) % 2, 1.0, -1.0)
    return xr.Dataset(
        {
            "mean_angle": (("spring", "repeat", "joint"), (side * bends)[..., None] * _MODE),
            "bend": (("spring", "repeat"), bends),
            "axis_radius": (("spring", "repeat"), _LENGTH / bends),
            "settled": (("spring", "repeat"), np.ones(bends.shape, dtype=bool)),
            "direction": (
                ("spring", "repeat"),
                np.where(straight, "straight", np.where(side > 0.0, "right", "left")).astype(object),
            ),
            "moved": (("spring", "repeat"), np.zeros_like(bends)),
            "speed": (("spring", "repeat"), speed * (1.0 + 0.1 * scatter * noise)),
            "status": (("spring", "repeat"), np.full(bends.shape, "walked", dtype=object)),
        },
        coords={"spring": springs, "repeat": np.arange(repeats), "joint": np.arange(1, 6)},
        attrs={"robot": ROBOT.name},
    )


@cache
def durations(onsets, springs=SPRINGS, repeats=10, scatter=0.01):
    """The dataset of walks of several lengths, the onset of each given."""
    each = [series(springs, onset, repeats=repeats, scatter=scatter) for onset in onsets]
    return over_durations(each, [*SHORTER, 90.0])


@cache
def _walks():
    variants = {
        "k2-5 = 28 N*mm/deg": series(VARIANT_SPRINGS, 23.0),
        "stride 1.8 cm": series(VARIANT_SPRINGS, 25.0),
        "module phase 180 deg": series(VARIANT_SPRINGS, 31.0, 1.2 * AMPLITUDE),
    }
    examples = xr.Dataset(
        {"joint_angle": (("time", "spring", "joint"), np.linspace(-0.1, 0.3, 30).reshape(3, 2, 5))},
        coords={"time": [0.0, 1.0, 2.0], "spring": [41.0, 15.0], "joint": np.arange(1, 6)},
    )
    uniform = xr.Dataset(
        {"end": ("mode", [18.0, 18.0]), "end_error": ("mode", [0.2, 0.2])},
        coords={"mode": [UNDULATION, BEND]},
        attrs={"amplitude": np.deg2rad(5.0)},
    )
    lower = {"stride 1.8 cm": series(VARIANT_SPRINGS, 25.0)}
    return RobotWalks(series(SPRINGS, 34.0), durations((34.0,) * 5), variants, lower, examples, uniform)


def walks(**changes):
    """What the paper prints of its robot, met in everything."""
    return dataclasses.replace(_walks(), **changes)


def base_walks(**changes):
    """The same of the robot as built alone."""
    return walks(**{"variants": {}, "lower_steps": {}, "uniform": None, **changes})


def task(springs, best, lowest, outcomes, *, wiggle=0.01, time=23.0, repeats=5, target="45 deg, 1.3 m", seed=0):
    """A turning task whose criteria have a parabola in 1/k1 with its vertex at ``best`` (N*mm/deg).

    Parameters
    ----------
    lowest
        Of every criterion, by name.
    outcomes
        Of all trials, by spring.
    wiggle
        How much trials of one seed lie above or below, relative; every seed has its own at every spring.
    """
    rng = np.random.default_rng(seed)
    springs = np.asarray(springs, float)
    noise = wiggle * rng.standard_normal((len(springs), repeats))
    parabola = 1.0 + (40.0 * (1.0 / springs - 1.0 / best))[:, None] ** 2
    data = xr.Dataset(coords={"spring": springs, "repeat": np.arange(repeats)})
    data["seconds"] = ("instant", [time, 23.0, np.nan])
    for name in CRITERIA:
        values = lowest.get(name, 1.0) * (parabola + noise)
        until = name == "effort_until_arrival"
        data[name] = (
            (("spring", "repeat"), values) if until else (("instant", "spring", "repeat"), np.stack([values] * 3))
        )
        data[f"{name}_mean"] = data[name].mean("repeat")
        data[f"{name}_error"] = data[name].std("repeat", ddof=1) / np.sqrt(repeats)
    labels = np.array([[outcomes[float(spring)]] * repeats for spring in springs], dtype=object)
    data["outcome"] = (("spring", "repeat"), labels)
    return TurningTask(Target.parse(target), data, xr.Dataset())


@cache
def _turning():
    springs = (15.0, 17.0, 21.0, 26.0, 28.0, 34.0, 41.0)
    inside, arrived, outside = Outcome.INSIDE.label, Outcome.ARRIVED.label, Outcome.OUTSIDE.label
    outcomes = {k: inside if k < 17.0 else outside if k > 34.0 else arrived for k in springs}
    lowest = {"distance": 0.1, "angle": 0.05, "effort": 0.2}
    tasks = {
        letter: task(springs, best, lowest, outcomes, wiggle=1e-3, target=target)
        for letter, best, target in (("A", 21.0, "45 deg, 1.3 m"), ("B", 26.0, "40 deg, 1.5 m"))
    }
    higher = {name: 1.5 * value for name, value in lowest.items()}
    alone = xr.Dataset(
        {
            "leg_yaw": ("case", [False, True]),
            "arrived": (("case", "trial"), [[0.0] * 9, [1.0] * 5 + [np.nan] * 4]),
            "turned": (("case", "trial"), [[1.0, -1.0] * 4 + [1.0], [1.0] * 9]),
            "spring": ("case", [21.0, 21.0]),
        },
        coords={"case": ["paper's spring, without", "paper's spring, with"]},
    )
    hopf = task((8.7, 11.0, 15.0), 11.0, higher, dict.fromkeys((8.7, 11.0, 15.0), arrived), wiggle=1e-3, seed=1)
    return RobotTurning(ROBOT, tasks, hopf, alone)


def turning(**changes):
    """The paper's tasks, met in everything."""
    return dataclasses.replace(_turning(), **changes)


def with_criteria(criteria, letter="A"):
    """The paper's tasks, one with other criteria, and no uniform springs."""
    tasks = turning().tasks
    return turning(tasks={**tasks, letter: dataclasses.replace(tasks[letter], criteria=criteria)}, hopf=None)
