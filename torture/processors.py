"""Other processors: the same computation with OpenBLAS's kernels for them, and compiled without FMA and AVX. The
verdicts are the same, and the numbers are within their bounds of each other."""

from __future__ import annotations

import json
import math
import os
import platform
import subprocess
import sys
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from in_process import Place
from outcomes import FoundFault, Kind, Outcome


def foreign() -> dict[str, dict[str, str]]:
    """Processors that this one can stand for, with the variables that choose each."""
    found = {"own": {}, "generic": {"NUMBA_CPU_NAME": "generic"}}
    if platform.machine() in ("x86_64", "AMD64"):
        info = Path("/proc/cpuinfo")
        kernels = ["Haswell", "Zen", "Nehalem"]
        # OpenBLAS does not look whether the processor has what its kernels need.
        kernels += ["SkylakeX"] * (info.exists() and "avx512vl" in info.read_text())
        found |= {kernel: {"OPENBLAS_CORETYPE": kernel} for kernel in kernels}
    return found


class Processors:
    """One computation on all of them."""

    name = "processors"
    per_minute = 40

    def __init__(self) -> None:
        self._running: dict[str, subprocess.Popen[str]] = {}

    def attack(self, chance: Random, place: Place) -> Outcome:
        """Compute, and compare."""
        seed = chance.getrandbits(60)
        if not self._running:  # what is compiled first is not watched
            for case in range(len(CASES)):
                self._answers(case)
        place.tried.write_text(f"processors: {CASES[seed % len(CASES)].__name__[1:]} {seed}")
        answers = self._answers(seed)
        right = answers.pop("own")
        for name, answer in answers.items():
            compare(right, answer, name)
        return Outcome(Kind.ENDED)

    def _answers(self, seed: int) -> dict[str, list[Any]]:
        """Answers of all processes, which compute side by side."""
        pipes = {name: self._pipes(name, variables) for name, variables in foreign().items()}
        for into, _ in pipes.values():
            into.write(f"{seed}\n")
            into.flush()
        answers = {}
        for name, (_, out) in pipes.items():
            line = out.readline()
            if not line:
                raise FoundFault(Kind.CRASH, f"{name}: exit code {self._running[name].wait()}")
            answers[name] = json.loads(line)
        return answers

    def _pipes(self, name: str, variables: dict[str, str]) -> tuple[Any, Any]:
        process = self._running.get(name)
        if process is None or process.poll() is not None:
            process = self._running[name] = subprocess.Popen(
                [sys.executable, __file__],
                env={**os.environ, **variables},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        return process.stdin, process.stdout


def compare(right: list[Any], answer: list[Any], name: str) -> None:
    """Make sure that two answers say the same: verdicts alike, numbers within both bounds."""
    if [each[0] for each in right] != [each[0] for each in answer]:
        raise FoundFault(Kind.WRONG, f"{name}: {[each[0] for each in answer]}, not {[each[0] for each in right]}")
    for (what, number, bound), (_, other, also) in zip(right, answer, strict=True):
        # The bounds are of what is computed, and the number is rounded to double precision besides.
        within = bound + also + 4e-16 * math.hypot(*number)
        if not math.hypot(number[0] - other[0], number[1] - other[1]) <= within:
            raise FoundFault(Kind.WRONG, f"{name}: {what}: {other}, not {number}, and the bounds allow {within:.1e}")


def _said(verdict: Any, number: complex = 0.0, bound: float = 0.0) -> list[Any]:
    return [str(verdict), [float(np.real(number)), float(np.imag(number))], float(bound)]


def _points(found: Any) -> list[Any]:
    """Status and points; places are compared in the order in which they come."""
    points = [_said(f"{p.kind.name} {p.criticality.name}", p.value, p.error_bound) for p in found]
    return [_said(found.status.name), *points]


def _robot_multipliers(chance: Random) -> list[Any]:
    from chilopod import stability
    from chilopod.planar import PlanarModel
    from some_robots import some_robot

    found = stability.multipliers(PlanarModel(some_robot(chance)))
    # By how many turns they are ordered is no verdict where moduli are alike: the largest is compared.
    return [_said(f"stable: {found.stable}", abs(found.values[0]), found.error_bound)]


def _robot_points(chance: Random) -> list[Any]:
    from chilopod.analysis import bifurcations
    from some_robots import some_robot

    robot = some_robot(chance).with_value("body.modules", 6)
    found = bifurcations(robot, "springs.stiffness[0]", (0.2, 3.0))
    return [_said(each.point.kind.name, each.point.value, each.point.error_bound) for each in found]


def _mathieu(chance: Random) -> list[Any]:
    from chilopod.stability import from_rhs, locate

    q, damping = chance.uniform(0.1, 2.0), chance.choice((0.0, chance.uniform(0.0, 0.2)))

    def swing(t: Any, x: Any, a: float) -> list[Any]:
        return [x[1], -(a - 2.0 * q * np.cos(2.0 * t)) * x[0] - damping * x[1]]

    return _points(locate(lambda a: from_rhs(swing, 2, np.pi, args=(a,), orbit=[0.0, 0.0]), (-1.0, 5.0)))


def _duffing(chance: Random) -> list[Any]:
    from chilopod.stability import from_rhs, locate

    damping = chance.uniform(0.15, 0.3)

    def duffing(t: Any, x: Any, force: float) -> list[Any]:
        return [x[1], force * np.cos(t) - damping * x[1] - x[0] ** 3]

    def family(force: float) -> Any:
        return from_rhs(duffing, 2, 2.0 * np.pi, args=(force,), symmetry=-np.eye(2))

    return _points(locate(family, (2.0, 3.0), orbit=[1.9, 0.6]))


def _cycle(chance: Random) -> list[Any]:
    from chilopod.stability import exponents, from_rhs

    mu = 10.0 ** chance.uniform(-1.0, 1.3)

    def rhs(t: Any, x: Any) -> list[Any]:
        return [x[1], mu * (1.0 - x[0] ** 2) * x[1] - x[0]]

    found = exponents(from_rhs(rhs, 2, None, guess_period=6.3 + 1.6 * mu), [2.0, 0.0])
    return [_said(f"stable: {found.multipliers.stable}", found.values[0], found.error_bound[0])]


def _graded(chance: Random) -> list[Any]:
    """Exponents of a flow with rates many orders of magnitude apart."""
    from scipy.linalg import expm

    from chilopod.stability import PeriodicSystem, exponents

    n = chance.randrange(2, 6)
    rates = np.array([-(10.0 ** chance.uniform(-2.0, 1.0)) * chance.choice((1.0, 1.0, -0.1)) for _ in range(n)])
    slant = np.eye(n) + 0.3 * np.array([[chance.gauss(0.0, 1.0) for _ in range(n)] for _ in range(n)]) / n
    generator = slant @ np.diag(rates) @ np.linalg.inv(slant)

    def flow(x: Any, t0: float, t1: float) -> tuple[Any, Any]:
        matrix = expm(generator * (t1 - t0))
        return matrix @ x, matrix

    # scipy's exponential rounds itself; the known rates are what the answers are held against.
    found = exponents(PeriodicSystem(n, 2.0 * np.pi, flow, orbit=np.zeros(n)))
    off = np.abs(np.sort(found.values.real) - np.sort(rates)).max() / np.abs(rates).max()
    return [_said(f"stable: {found.multipliers.stable}, within 1e-9: {off < 1e-9}")]


def _crossings(chance: Random) -> list[Any]:
    """Multipliers up to sixty orders of magnitude apart, one or two of which cross the circle."""
    from chilopod.stability.unit_circle.crossings import find_crossings

    spread, middle = chance.uniform(0.0, 70.0), chance.uniform(0.1, 0.9)
    rates = [lambda p: spread, lambda p: p - spread - 1.5, lambda p: chance_sign * (p - middle)]
    chance_sign = chance.choice((-1.0, 1.0))
    order = chance.sample(range(3), 3)

    def matrices(values: Any) -> tuple[Any, Any]:
        each = [np.diag(np.exp([rates[k](p) for k in order])) for p in values]
        return np.array(each), np.full(values.size, 1e-16)

    found = find_crossings(matrices, 0.0, 1.0)
    return [
        _said(found.status.name),
        *(_said(f"{c.event.name} {c.multiplicity} {c.change}", c.value, 1e-14) for c in found.crossings),
    ]


CASES = (_robot_multipliers, _robot_points, _mathieu, _duffing, _cycle, _graded, _crossings)


def main() -> None:
    """Answer the seeds that come in, a line each."""
    for line in iter(sys.stdin.readline, ""):
        seed = int(line)
        try:
            answer = CASES[seed % len(CASES)](Random(seed))
        except Exception as error:
            answer = [_said(f"{type(error).__name__}: {error}")]
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
