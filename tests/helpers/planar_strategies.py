"""Random robots, drawn by their dimensionless numbers so that every one is a machine one could build."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

from chilopod import Robot


def log_floats(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers whose logarithm is spread evenly."""
    return st.floats(math.log(low), math.log(high)).map(math.exp)


def phases() -> st.SearchStrategy[float]:
    """Phases, rad, in steps of 1e-6 turns: what differs by less than 1e-12 turns is meant equal and taken as such."""
    return st.integers(-1_000_000, 1_000_000).map(lambda n: n * 1e-6 * 2.0 * math.pi)


SIZES = st.integers(2, 12)


@st.composite
def robots(draw, modules=SIZES, side_phase=None, own_inertia=None):
    """A robot; the number of modules, ``side_phase`` (rad) and ``own_inertia`` (of a rod) are strategies.

    Duty factors lie on both sides of one half.
    """
    n = draw(modules)
    length, mass, period = draw(log_floats(0.05, 0.5)), draw(log_floats(0.1, 10.0)), draw(log_floats(0.2, 2.0))
    inertia = mass * length**2 / 12.0
    own_inertia = draw(st.one_of(st.none(), log_floats(0.3, 3.0)) if own_inertia is None else own_inertia)
    duty = draw(st.floats(0.15, 0.9))
    if side_phase is None:
        side_phase = st.one_of(st.just(math.pi), st.just(0.0), phases())
    frequency = draw(st.lists(log_floats(0.5, 100.0), min_size=n - 1, max_size=n - 1))  # radians in a period
    loss = draw(st.lists(log_floats(0.1, 100.0), min_size=n - 1, max_size=n - 1))  # decay exponents in a period
    has_dampers = draw(st.booleans())
    return Robot(
        name="random",
        body={
            "modules": n,
            "length": n * length,
            "mass": n * mass,
            **({} if own_inertia is None else {"yaw_inertia": own_inertia * inertia}),
        },
        springs={
            "stiffness": [inertia * (f / period) ** 2 for f in frequency],
            "damping": [inertia * d / period if has_dampers else 0.0 for d in loss],
        },
        legs={
            "forward_offset": length * draw(st.floats(-0.5, 0.5)),
            "half_width": length * draw(st.sampled_from([0.0, 0.3]) | st.floats(0.01, 0.6)),
        },
        gait={
            "stride": length * draw(st.floats(0.02, 1.5)),
            "stance": duty * period,
            "swing": (1.0 - duty) * period,
            "module_phase": draw(st.one_of(st.sampled_from([1, 2, 3]).map(lambda q: 2 * math.pi / q), phases())),
            "side_phase": draw(side_phase),
        },
        ground={"friction": mass / period * draw(log_floats(2.0, 200.0))},
    )


def state_of(model, seed: int, bend: float = 0.5) -> np.ndarray:
    """A state away from the straight walk: joints bent by up to ``bend`` rad, speeds of the size of the walk's."""
    rng = np.random.default_rng(seed)
    n, gait, length = model.modules, model.robot.gait, model.robot.module_length
    return np.concatenate(
        [
            model.orbit[:2] + 0.3 * gait.speed * rng.normal(size=2),
            0.3 * gait.speed / length * rng.normal(size=1),
            bend * rng.uniform(-1.0, 1.0, n - 1),
            0.3 * gait.speed / length * rng.normal(size=n - 1),
        ]
    )


def mid_interval(model, fraction: float, inside: float = 0.5) -> float:
    """A time within one of the longer contact intervals, well away from switches."""
    times = model.schedule.times
    widths = np.diff(times)
    wide = np.flatnonzero(widths >= 0.2 * widths.max())
    i = wide[min(int(fraction * len(wide)), len(wide) - 1)]
    return float(times[i] + inside * widths[i])


def beside(x) -> np.ndarray:
    """The state one bit beside another."""
    return np.append(np.nextafter(x[0], np.inf), x[1:])


def nonlinear_flow(model, x, t0: float, t1: float) -> tuple[np.ndarray, np.ndarray]:
    """State and derivative by the nonlinear equations, on the straight walk too: from a state one bit beside it."""
    start = beside(x)
    assert not np.array_equal(start, model.orbit)
    return model.flow(start, t0, t1)


def energy_rate(model, x, slope, stiffness=None):
    """d(energy)/dt along ``slope`` with fixed springs, by a complex step through the definition of the energy."""
    springs = model.stiffness if stiffness is None else stiffness
    robot, n, half = model.robot, model.modules, 0.5 * model.robot.module_length
    z = x + 1e-30j * slope
    heading = np.concatenate([[0.0], np.cumsum(z[3 : n + 2])])
    rate = z[2] + np.concatenate([[0.0], np.cumsum(z[n + 2 :])])
    vx, vy, total = z[0], z[1], 0.0
    for i in range(n):
        if i:
            for k in (i - 1, i):
                vx, vy = vx + half * rate[k] * np.sin(heading[k]), vy - half * rate[k] * np.cos(heading[k])
        total += 0.5 * robot.module_mass * (vx**2 + vy**2) + 0.5 * robot.module_yaw_inertia * rate[i] ** 2
    return (total + 0.5 * (springs * z[3 : n + 2] ** 2).sum()).imag / 1e-30
