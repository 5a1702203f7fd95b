"""Onset of curved walks without trials: the value of a parameter at which the multiplier of a bend passes 1."""

from __future__ import annotations

from collections.abc import Callable

from chilopod import units
from chilopod.analysis.cycle_modes import CycleMultipliers
from chilopod.errors import AnalysisError, ParameterError
from chilopod.robot import Robot
from chilopod.statistics import Interval

_MOST = 8  # multipliers between the ends


def bend_onset(
    multipliers: Callable[[Robot], CycleMultipliers], robot: Robot, parameter: str, between: tuple[float, float]
) -> Interval:
    """Value of a parameter at which the multiplier of a bend of finite size passes 1, in SI units, by regula falsi
    until 1 lies in the multiplier's interval; that interval over the slope is the interval of the value."""

    def shown(value: float) -> str:
        return units.format(value, robot.unit_of(parameter), digits=6)

    def excess(value: float) -> tuple[float, float]:
        bends = [mode for mode in multipliers(robot.with_value(parameter, value)).finite if mode.shape == "bend"]
        if not bends:
            raise AnalysisError("has no bend among its leading modes", field=parameter, value=shown(value))
        return bends[0].multiplier.real - 1.0, bends[0].error

    (a, b), (at_a, at_b) = between, [excess(end)[0] for end in between]
    if at_a * at_b > 0.0:
        said = f"must hold an onset; the multiplier is {1.0 + at_a:.4f} and {1.0 + at_b:.4f} at its ends"
        raise ParameterError(
            said, field="onset", value=f"{shown(a)} to {shown(b)}", allowed="values on both sides of 1"
        )
    return crossing(excess, (a, at_a), (b, at_b))


def crossing(
    excess: Callable[[float], tuple[float, float]],
    one: tuple[float, float],
    other: tuple[float, float],
    tolerance: float = 0.0,
) -> Interval:
    """Value at which an excess passes 0, between two values with excesses of different signs, by regula falsi until the
    excess is below its error or the tolerance; its error over the slope is the interval. ``excess`` returns both."""
    (a, at_a), (b, at_b) = one, other
    for _ in range(_MOST):
        slope = (at_b - at_a) / (b - a)
        value = a - at_a / slope
        at, error = excess(value)
        if abs(at) <= max(error, tolerance):
            break
        a, at_a, b, at_b = (value, at, b, at_b) if at * at_a > 0.0 else (a, at_a, value, at)
    value -= at / slope
    return Interval(value, value - error / abs(slope), value + error / abs(slope))
