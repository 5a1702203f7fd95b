"""One's own systems: flows with derivatives, multipliers, points and branches, beside other tools, in one run.

Run by `make bench`; rewrites a table in README.md. The system is the forced Duffing oscillator x'' + 0.2 x' + x^3 =
F cos t, whose symmetric orbit loses its symmetry in a pitchfork at F = 2.40337711605714; the chain has 30 masses on
cubic springs (60 states). Peers are given the orbit or a bracket, and no error bound is asked of them. AUTO-07p is in
no package registry and therefore not here.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import functools
import time
from collections.abc import Callable
from math import pi
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from chilopod.stability import PeriodicSystem, find_orbit, follow, from_rhs, locate, multipliers, switch

import _timing
from _timing import duration, machine, table, write_section

Array = NDArray[np.float64]

median_seconds = functools.partial(_timing.median_seconds, clock=time.process_time)  # others may compute beside

PITCHFORK = 2.40337711605714358988
STATE = np.array([1.87793925257730701435, 0.63506904472679528861])
MIRROR = -np.eye(2)
MASSES = 30


def duffing(force: float) -> PeriodicSystem:
    return from_rhs(_duffing, 2, 2 * pi, args=(force,), symmetry=MIRROR)


def _duffing(t: float, x: Any, force: float) -> Any:
    return [x[1], -0.2 * x[1] - x[0] ** 3 + force * np.cos(t)]


def _chain(t: float, x: Any) -> Any:
    stretch = np.diff(np.concatenate([[0.0], x[:MASSES], [0.0]]))
    force = stretch + 0.3 * stretch**3
    return np.concatenate([x[MASSES:], np.diff(force) - 0.1 * x[MASSES:] + 0.2 * np.cos(t) * np.ones(MASSES)])


def scipy_duffing(force: float, x: Array) -> tuple[Array, Array]:
    """State and derivative over half a period by DOP853."""

    def both(t: float, y: Array) -> Array:
        jacobian = np.array([[0.0, 1.0], [-3.0 * y[0] ** 2, -0.2]])
        slope = [y[1], -0.2 * y[1] - y[0] ** 3 + force * np.cos(t)]
        return np.concatenate([slope, (jacobian @ y[2:].reshape(2, 2)).ravel()])

    y = solve_ivp(both, (0.0, pi), np.append(x, np.eye(2)), method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    return y[:2], y[2:].reshape(2, 2)


def exact_derivative() -> Array:
    """The derivative over half a period with thirty digits, by mpmath's Taylor series."""

    def both(t: Any, y: Any) -> Any:
        x, v, *d = y
        bend = -3 * x * x
        slopes = [v, -v / 5 - x**3 + mpmath.mpf(PITCHFORK) * mpmath.cos(t)]
        return [*slopes, d[2], d[3], bend * d[0] - d[2] / 5, bend * d[1] - d[3] / 5]

    with mpmath.workdps(30):
        start = [mpmath.mpf(float(value)) for value in (*STATE, 1.0, 0.0, 0.0, 1.0)]
        y = mpmath.odefun(both, 0, start)(mpmath.pi)
        return np.array([float(value) for value in y[2:]]).reshape(2, 2)


def heyoka_duffing() -> Callable[[float, Array], tuple[Array, Array]]:
    import heyoka as hk

    x, v = hk.make_vars("x", "v")
    equations = [(x, v), (v, -0.2 * v - x**3 + hk.par[0] * hk.cos(hk.time))]
    integrator = hk.taylor_adaptive(hk.var_ode_sys(equations, hk.var_args.vars), [0.0, 0.0], tol=1e-15)

    def flow(force: float, state: Array) -> tuple[Array, Array]:
        integrator.time = 0.0
        integrator.pars[0] = force
        integrator.state[:2] = state
        integrator.state[2:] = [1.0, 0.0, 0.0, 1.0]
        integrator.propagate_until(pi)
        return integrator.state[:2].copy(), integrator.state[2:].reshape(2, 2).copy()

    return flow


def pitchfork(flow: Callable[[float, Array], tuple[Array, Array]]) -> float:
    """The pitchfork by Newton's method for the orbit inside brentq for its multiplier -1."""
    x = STATE.copy()

    def beyond(force: float) -> float:
        nonlocal x
        for _ in range(8):
            end, matrix = flow(force, x)
            residual = -end - x
            x = x - np.linalg.solve(-matrix - np.eye(2), residual)
            if np.abs(residual).max() < 1e-13:
                break
        return float(np.linalg.det(-matrix + np.eye(2)))

    return float(brentq(beyond, 2.2, 2.6, xtol=1e-14))


def rows() -> list[list[str]]:
    system = duffing(PITCHFORK)
    known = from_rhs(_duffing, 2, 2 * pi, args=(PITCHFORK,), symmetry=MIRROR, orbit=find_orbit(system, STATE).state)
    chain = from_rhs(_chain, 2 * MASSES, 2 * pi)
    start = 0.1 * np.sin(np.arange(2.0 * MASSES))
    (point,) = locate(duffing, (2.2, 2.6), orbit=[1.88, 0.64])
    (leaving, *_) = switch(duffing, point)
    peers = {"scipy DOP853": scipy_duffing}
    try:
        peers["heyoka"] = heyoka_duffing()
    except ImportError:
        print("heyoka is not installed here: left out")
    found: list[list[str]] = []

    def add(what: str, who: str, seconds: float, error: str) -> None:
        found.append([what, who, duration(seconds), error])

    exact = exact_derivative()

    def off(derivative: Array) -> str:
        return f"{np.abs(derivative - exact).max() / np.abs(exact).max():.0e}"

    seconds = median_seconds(lambda: system.flow(STATE, 0.0, pi))
    add("flow and derivative, half a period", "**chilopod**", seconds, off(system.flow(STATE, 0.0, pi)[1]))
    for name, peer in peers.items():
        add("", name, median_seconds(lambda f=peer: f(PITCHFORK, STATE)), off(peer(PITCHFORK, STATE)[1]))
    add("multipliers with their error bound", "**chilopod**", median_seconds(lambda: multipliers(known)), "")
    own = median_seconds(lambda: locate(duffing, (2.2, 2.6), orbit=[1.88, 0.64]))
    add(
        "pitchfork in 2.2 to 2.6, from a guess",
        "**chilopod**: bound, all others excluded, kind, coefficient",
        own,
        f"{abs(point.value / PITCHFORK - 1):.0e}",
    )
    for name, peer in peers.items():
        missed = f"{abs(pitchfork(peer) / PITCHFORK - 1):.0e}"
        add("", f"{name}, brentq", median_seconds(lambda f=peer: pitchfork(f), at_least=3), missed)
    seconds = median_seconds(lambda: follow(duffing, leaving, (1.0, 40.0), points=100), at_least=3)
    add("100 points of the branch that leaves it", "**chilopod**: with multipliers and special points", seconds, "")
    add("60 states: flow and derivative", "**chilopod**", median_seconds(lambda: chain.flow(start, 0.0, 2 * pi)), "")
    return found


def main() -> None:
    load = f" CPU time of one core; load average before: {os.getloadavg()[0]:.1f}."
    text = table(["what", "who", "time", "relative error"], rows())
    write_section("periodic-systems", machine() + load + "\n\n" + text)


if __name__ == "__main__":
    main()
