"""A minute of nonlinear walking beside other tools, cost of a step as the robot grows, steered tasks; in one run.

Run by `make bench`; rewrites the tables in README.md. Every tool walks the same robot from the same small bend into its
curved walk, on one core, at each of its settings; what is shown is its fastest run whose final pose (m, rad) is within
1e-6 of the reference, or else its most accurate one. The reference is the plainly written model of peer_simulation.py
at a tolerance of 1e-11; the machine may be busy, so the best of several timings counts.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # one core for everybody
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numba
import numpy as np

from chilopod.engine import Command, Event, Observation
from chilopod.gait import Gait
from chilopod.integrate import integrator
from chilopod.planar import PlanarModel, initial_states, simulate
from chilopod.planar.dynamics import rhs
from chilopod.planar.model import carry
from chilopod.robot import Robot, load_robot

from _timing import duration, machine, table, write_section
from peer_model import N_MM_PER_DEG, Array, with_springs
from peer_simulation import Call, Walk, available, compiled_segments, reference

TARGET = 1e-6  # of the final pose, m and rad
EASIER = {"MuJoCo": 1e-4}  # made for coarser steps: judged by this
TOLERANCES = [10.0**-k for k in range(3, 10)]
PERIODS = 100
MODULES = (6, 12, 24, 48, 96)
FIRST_SPRING = 10.0  # N*mm/deg: below the pitchfork at 12, the robot goes over into a stable curved walk
TASKS, TASK = 1000, 23.0  # s
PRESET = load_robot("aoi2022-planar")


def bent(robot: Robot) -> Array:
    """The straight walk with joint 1 bent by 2 degrees."""
    x = PlanarModel(robot).orbit.copy()
    x[3] = np.radians(2.0)
    return x


def with_modules(modules: int) -> Robot:
    """The preset with more modules of the same length and mass, the first spring soft."""
    robot = PRESET.with_value("body.modules", modules)
    for name, value in (("body.length", PRESET.body.length), ("body.mass", PRESET.body.mass)):
        robot = robot.with_value(name, value * modules / PRESET.body.modules)
    return robot.with_value("springs.stiffness[0]", FIRST_SPRING * N_MM_PER_DEG)


# ---- chilopod -----------------------------------------------------------------------------------------------------


def ours(robot: Robot, start: Array, seconds: float, tolerance: float) -> Call:
    """A call that carries a robot from `start` at the pose (0, 0, 0) and returns the final pose (x, y, heading)."""
    model = PlanarModel(robot, tolerance)

    def compute() -> Array:
        state = np.append(start, np.zeros(3))[None]
        carry([model], state, 0.0, seconds, model.tolerance)
        return state[0, -3:]

    return compute


def ours_recorded(robot: Robot, start: Array, seconds: float, tolerance: float) -> Call:
    """The same by the public simulation, with a record of everything at 100 Hz."""
    initial = np.append(start, np.zeros(3))

    def compute() -> Array:
        last = simulate(robot, seconds, initial=initial, tolerance=tolerance).isel(time=-1, robot=0)
        return np.append(last.position.values, last.heading.values)

    return compute


# ---- a minute of walking ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Run:
    """One measured computation."""

    setting: float
    seconds: float
    error: float


def best_seconds(call: Callable[[], object], budget: float = 1.0, at_least: int = 3) -> float:
    """Shortest wall time of one call, over as many calls as the budget (seconds) allows."""
    times: list[float] = []
    while len(times) < at_least or sum(times) < budget:
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def best(name: str, prepare: Callable[[float], Call], settings: list[float], truth: Array) -> Run:
    """The fastest run within the target, or else the most accurate; settings go from coarse to fine."""
    target = next((value for prefix, value in EASIER.items() if name.startswith(prefix)), TARGET)
    runs: list[Run] = []
    for setting in settings:
        call = prepare(setting)
        error = float(np.abs(call() - truth).max())
        print(f"{name} at {setting:.1e}: error in the final pose {error:.1e}", flush=True)
        runs.append(Run(setting, best_seconds(call) if error <= target else np.inf, error))
        if sum(run.error <= target for run in runs) == 2:  # still finer can only be slower
            break
    if all(run.error > target for run in runs):
        closest = min(runs, key=lambda run: run.error)
        return Run(closest.setting, best_seconds(prepare(closest.setting), 0.0, 2), closest.error)
    return min(runs, key=lambda run: run.seconds)


def minute() -> str:
    robot = with_modules(6)
    walk = Walk(robot, with_springs(FIRST_SPRING, 41.0), bent(robot), PERIODS)
    seconds = PERIODS * walk.robot.period
    truth = reference(walk)
    runs = {
        f"**chilopod**{what}": best(
            f"chilopod{what}", lambda tol, call=call: call(robot, walk.start, seconds, tol), TOLERANCES, truth
        )
        for what, call in (("", ours), (", with a record at 100 Hz", ours_recorded))
    }
    for name, (peer, settings) in available().items():
        runs[name] = best(name, lambda setting, p=peer: p(walk, setting), settings, truth)
    mine = runs["**chilopod**"].seconds
    rows = []
    for name, run in sorted(runs.items(), key=lambda item: item[1].seconds):
        ratio, unit = run.seconds / mine, " s step" if name.startswith("MuJoCo") else ""
        times = f"{ratio:.0f}" if ratio > 10 else f"{ratio:.2f}"
        setting = f"{run.setting:.0e}{unit}"
        rows.append([name, setting, duration(run.seconds), times, f"{seconds / run.seconds:.0f}", f"{run.error:.0e}"])
    title = f"**{seconds:.0f} s of robot time from a bend of 2 degrees into the curved walk, one core**"
    return f"{title}\n\n" + table(["who", "setting", "time", "ratio", "times real time", "error"], rows)


# ---- thousands of closed-loop tasks -------------------------------------------------------------------------------


class TowardsTarget:
    """Legs of module 1 turned by half the bearing of the target, 20 degrees at the most, as each side touches down."""

    def events(self, gait: Gait) -> list[Event]:
        return [Event("left", 0.0, gait.swing), Event("right", 0.5, gait.swing)]

    def act(self, event: Event, seen: Observation) -> Command:
        angle = np.clip(0.5 * seen.bearing, -np.radians(20.0), np.radians(20.0))
        return Command(leg_yaw=np.stack([angle, angle], axis=-1))


def closed_loop(threads: int) -> str:
    """Many steered tasks at once with their records, on one thread and on all."""
    robot = with_modules(6)
    rng = np.random.default_rng(0)
    bends = rng.uniform(-0.05, 0.05, (TASKS, robot.body.modules - 1))
    directions = rng.uniform(-1.0, 1.0, TASKS)
    target = 3.0 * np.stack([np.cos(directions), np.sin(directions)], axis=-1)
    options = {"initial": initial_states(robot, bends), "controller": TowardsTarget(), "target": target}
    rows, ends = [], []
    for count, rate in ((1, 10.0), (threads, 10.0), (threads, 100.0)):
        numba.set_num_threads(count)
        found: list[Any] = [None]

        def call(rate: float = rate, found: list[Any] = found) -> None:
            found[0] = simulate(robot, TASK, rate=rate, **options)

        taken = best_seconds(call, budget=0.0, at_least=2)
        speed = TASKS * TASK / taken
        rows.append([str(count), f"{rate:.0f} Hz", duration(taken), f"{TASKS / taken:.0f}", f"{speed:.0f}"])
        ends.append((taken, found[0]))
    (first, one), (last, many), _ = ends
    same = np.array_equal(one.position, many.position, equal_nan=True)
    finished = int((many.status == "walked").sum())
    title = f"**{TASKS} steered tasks of {TASK:.0f} s, two commands a gait cycle, with records**"
    note = (
        f"{threads} threads are {first / last:.2f} times as fast as one (10 Hz); the records are "
        f"{'the same to the bit' if same else 'NOT the same'}. {finished} of {TASKS} walked to the end."
    )
    head = ["threads", "record", "time", "tasks per second", "times real time"]
    return f"{title}\n\n" + table(head, rows) + f"\n\n{note}"


# ---- cost of a step over the number of modules --------------------------------------------------------------------


@numba.njit
def counted_rhs(t, x, args, out):
    inner, calls = args
    calls[0] += 1
    rhs(t, x, inner, out)


def steps_taken(walk: Walk, tolerance: float) -> float:
    """Steps of chilopod's integrator over the whole walk; its own loop, with a right-hand side that counts."""
    integrate = integrator(counted_rhs, on_disk=False)
    x, h, calls = np.append(walk.start, np.zeros(3)), 0.0, np.zeros(1, np.int64)
    work = np.empty((16, x.size))
    for _ in range(walk.periods):
        for width, args in compiled_segments(walk.file):
            h, reached = integrate((args, calls), x, 0.0, width, h, tolerance, work)
            assert reached
    return float(calls[0]) / 12.0  # evaluations in a step


def growth(tolerance: float = 1e-7, periods: int = 10) -> str:
    rows, costs = [], []
    for n in MODULES:
        robot = with_modules(n)
        walk = Walk(robot, with_springs(FIRST_SPRING, 41.0, n), bent(robot), periods)
        seconds = periods * robot.gait.period
        taken = best_seconds(ours(robot, walk.start, seconds, tolerance), budget=1.0, at_least=10)
        steps = steps_taken(walk, tolerance)
        costs.append(taken / steps)
        rows.append([str(n), duration(taken / seconds), f"{steps / seconds:.0f}", f"{costs[-1] * 1e6:.2f} µs"])
    exponent = np.polyfit(np.log(MODULES), np.log(costs), 1)[0]
    title = f"**Cost of a step over the number of modules: grows as modules to the power {exponent:.2f}**"
    return f"{title}\n\n" + table(["modules", "time per second walked", "steps per second walked", "a step"], rows)


def versions() -> str:
    """Of the peers that only this file uses."""
    found = []
    for package in ("jax", "diffrax", "mujoco"):
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"no {package}")
    return ", ".join(found)


def main() -> None:
    threads = numba.get_num_threads()
    tasks = closed_loop(threads)
    numba.set_num_threads(1)
    parts = [f"{machine()} Also {versions()}.", minute(), growth(), tasks]
    numba.set_num_threads(threads)
    write_section("simulation", "\n\n".join(parts))


if __name__ == "__main__":
    main()
