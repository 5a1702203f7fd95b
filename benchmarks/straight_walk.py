"""Multipliers of the straight walk, a sweep over a spring and the pitchfork: chilopod beside other tools, in one run.

Run by `make bench`; rewrites the tables in README.md. Each peer is run at tolerances from 1e-8 to 1e-13; what is
shown is its fastest run with an error of at most 1e-12, or else its most accurate one. The error is that of the
multipliers, relative to the largest, against a Taylor series in extended precision (numpy's longdouble; eigenvalues
with 30 digits).
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # matrices of 13 x 13: threads only disturb
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mpmath
import numpy as np
from scipy.optimize import brentq, linear_sum_assignment

from chilopod import stability
from chilopod.planar import PlanarModel
from chilopod.robot import load_robot

from _timing import duration, machine, median_seconds, table, write_section
from peer_model import N_MM_PER_DEG, Array, PeerRobot, half_period_map, mirror
from peers import Map, available

TARGET = 1e-12
TOLERANCES = [10.0**-k for k in range(8, 14)]
SWEEP = np.linspace(5.0, 75.0, 64) * N_MM_PER_DEG
ROBOT = PeerRobot()
REST = ROBOT.stiffness[1:]
ROBOT_FILE = load_robot("aoi2022-planar")


@dataclass(frozen=True)
class Run:
    """One measured computation."""

    seconds: float
    error: float


# ---- chilopod: the only part of this file that uses it ------------------------------------------------------------


def ours(periods: float) -> Callable[[], Array]:
    """Multipliers with their error bound, of the half period (periods = 0.5) or the whole one (1.0)."""
    model = PlanarModel(ROBOT_FILE, use_symmetry=periods == 0.5)
    if periods == 0.5:
        return lambda: stability.multipliers(model).half_period
    return lambda: stability.multipliers(model).values


def first_spring(value: float) -> PlanarModel:
    return PlanarModel(ROBOT_FILE.with_value("springs.stiffness[0]", value))


def ours_sweep(first_springs: Array) -> Callable[[], Array]:
    """Half-period multipliers for each stiffness of the first joint (N*m/rad): shape (values, 13)."""
    return lambda: np.array([each.half_period for each in stability.sweep([first_spring(k) for k in first_springs])])


def ours_pitchfork(low: float, high: float, normal_form: bool) -> Callable[[], float]:
    """The pitchfork between two stiffnesses (N*mm/deg), with error bound, kind and mode; its value in N*m/rad."""
    between = (low * N_MM_PER_DEG, high * N_MM_PER_DEG)
    return lambda: stability.locate(first_spring, between, normal_form=normal_form)[-1].value


# ---- the reference and the errors against it ----------------------------------------------------------------------


def exact_multipliers(periods: float, first_spring: float = ROBOT.stiffness[0]) -> Array:
    robot = PeerRobot(stiffness=(first_spring, *REST))
    h = half_period_map(robot, np.longdouble)
    with mpmath.workdps(30):
        rows = [[mpmath.mpf(float(x)) + mpmath.mpf(float(x - np.longdouble(float(x)))) for x in row] for row in h]
        nu = mpmath.eig(mpmath.matrix(rows), left=False, right=False)
        return np.array([complex(x if periods == 0.5 else x * x) for x in nu])


def error(found: Array, exact: Array) -> float:
    distance = np.abs(np.asarray(found)[:, None] - exact[None, :])
    return float(distance[linear_sum_assignment(distance)].max() / np.abs(exact).max())


def multipliers_of(compute: Map, springs: Sequence[float], periods: float) -> Array:
    x = compute(springs)
    return np.linalg.eigvals(mirror(ROBOT) @ x if periods == 0.5 else x)


def best(attempts: Sequence[Run]) -> Run:
    good = [run for run in attempts if run.error <= TARGET]
    return min(good, key=lambda run: run.seconds) if good else min(attempts, key=lambda run: run.error)


def best_tolerance(prepare: Callable[[PeerRobot, float, float], Map], periods: float) -> tuple[Run, Map]:
    exact = exact_multipliers(periods)
    measured = []
    for tolerance in TOLERANCES:
        compute = prepare(ROBOT, periods, tolerance)
        try:
            wrong = error(multipliers_of(compute, ROBOT.stiffness, periods), exact)
        except (np.linalg.LinAlgError, RuntimeError) as problem:
            print(f"left out at tolerance {tolerance:.0e}: {problem}")
            continue
        seconds = median_seconds(lambda f=compute: multipliers_of(f, ROBOT.stiffness, periods), budget=0.3)
        measured.append((Run(seconds, wrong), compute))
    chosen = best([run for run, _ in measured])
    return next(pair for pair in measured if pair[0] is chosen)


# ---- the three tables ---------------------------------------------------------------------------------------------


def row(name: str, run: Run, fastest: float) -> list[str]:
    ratio = run.seconds / fastest
    return [name, duration(run.seconds), f"{ratio:.0f}" if ratio > 10 else f"{ratio:.1f}", f"{run.error:.0e}"]


def render(title: str, runs: dict[str, Run]) -> str:
    fastest = min(run.seconds for run in runs.values())
    order = sorted(runs.items(), key=lambda item: item[1].seconds)
    return f"**{title}**\n\n" + table(["who", "time", "ratio", "error"], [row(n, r, fastest) for n, r in order])


def measure_multipliers(periods: float) -> tuple[dict[str, Run], dict[str, Map]]:
    call = ours(periods)
    runs = {"**chilopod**": Run(median_seconds(call), error(call(), exact_multipliers(periods)))}
    maps: dict[str, Map] = {}
    for name, prepare in available().items():
        runs[name], maps[name] = best_tolerance(prepare, periods)
    return runs, maps


def measure_sweep(maps: dict[str, Map]) -> dict[str, Run]:
    checked = (0, 31, 63)
    exact = {i: exact_multipliers(0.5, SWEEP[i]) for i in checked}

    def judged(call: Callable[[], Array]) -> Run:
        found = call()
        wrong = max(error(found[i], exact[i]) for i in checked)
        return Run(median_seconds(call, budget=2.0, at_least=3), wrong)

    runs = {"**chilopod**": judged(ours_sweep(SWEEP))}
    for name, compute in maps.items():
        runs[name] = judged(lambda f=compute: np.array([multipliers_of(f, (k, *REST), 0.5) for k in SWEEP]))
    return runs


def measure_pitchfork(maps: dict[str, Map]) -> dict[str, Run]:
    def crossing(multipliers: Callable[[float], Array]) -> float:
        def beyond(k: float) -> float:
            nu = multipliers(k)
            return float(nu.real[np.abs(nu.imag) < 1e-9].min() + 1.0)

        low, high = (
            11.0 * N_MM_PER_DEG,
            13.0 * N_MM_PER_DEG,
        )  # wider, and two multipliers merge into a pair
        return float(brentq(beyond, low, high, xtol=1e-14, rtol=1e-14))

    def exact(k: float) -> Array:
        return np.linalg.eigvals(half_period_map(PeerRobot(stiffness=(k, *REST)), np.longdouble).astype(float))

    true = crossing(exact)
    runs = {}
    for low, high, normal_form in ((11.0, 13.0, False), (2.0, 75.0, False), (2.0, 75.0, True)):
        call = ours_pitchfork(low, high, normal_form)
        name = f"**chilopod**, {low:g} to {high:g}, error bound{', verdict' if normal_form else ''}"
        runs[name] = Run(median_seconds(call), abs(call() / true - 1.0))
    for name, compute in maps.items():

        def locate(f: Map = compute) -> float:
            return crossing(lambda k: multipliers_of(f, (k, *REST), 0.5))

        runs[f"{name}, brentq, 11 to 13"] = Run(median_seconds(locate, at_least=3), abs(locate() / true - 1.0))
    return runs


def main() -> None:
    whole, _ = measure_multipliers(1.0)
    half, maps = measure_multipliers(0.5)
    parts = [
        machine(),
        render("Multipliers, whole period (nobody uses the symmetry)", whole),
        render("Multipliers, half period and mirror (everybody uses the symmetry)", half),
        render("64 values of the first spring, 5 to 75 N*mm/deg, half period", measure_sweep(maps)),
        render("Pitchfork in the first spring, relative error of its value", measure_pitchfork(maps)),
    ]
    write_section("straight-walk", "\n\n".join(parts))


if __name__ == "__main__":
    main()
