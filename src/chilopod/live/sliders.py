"""Sliders of the page: one row of a table each. A new slider is one more row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from chilopod import units
from chilopod.analysis.parameters import ALL, PAPER_UNIT
from chilopod.live.state import Settings
from chilopod.robot import Robot

STRIDES = (0.2, 1.5)
"""Range of the stride, relative to the robot file."""

_SOFTEST, _STIFFEST = 0.05, 1.5  # of the stiffest spring of the file


@dataclass(frozen=True)
class Slider:
    """A number of the walk that can be changed while it goes on."""

    name: str  # in wishes; of a number of the robot file its path there
    key: str  # in an address
    label: str  # words beside the slider
    hint: str  # words that appear where the mouse rests on it
    unit: str  # at the page
    si: str  # unit of all values here
    limits: tuple[float, float]  # smallest and largest value
    step: float  # in the unit of the page
    read: Callable[[Settings], float]  # value of settings
    apply: Callable[[Settings, float], Settings]  # settings with a value
    keys: tuple[tuple[str, str], ...] = ()  # hot keys: smaller, larger, each with its words
    shift: bool = False  # True if the keys are pressed with shift
    factor: float = 1.1  # by which a key changes the value
    folder: str = ""  # of the panel, empty for none

    def at_page(self, value: float) -> float:
        """Value in the unit of the page."""
        return float(f"{units.from_si(value, self.unit):.9g}")

    def from_page(self, value: float) -> float:
        """Convert a value of the page to SI units."""
        return units.parse(f"{float(value)!r} {self.unit}", self.unit)


def sliders_of(file: Robot) -> dict[str, Slider]:
    """All sliders of a robot by name, in the order of the page."""
    stride = file.gait.stride
    rows = (
        *_springs(file),
        Slider(
            name="friction",
            key="friction",
            label="friction",
            hint="Friction of the floor, relative to the robot file",
            unit="",
            si="times that of the robot file",
            limits=(0.3, 3.0),
            step=0.05,
            read=lambda settings: settings.friction,
            apply=lambda settings, factor: _with_friction(settings, file, factor),
            keys=(("F", "Floor more slippery"), ("G", "Floor less slippery")),
        ),
        Slider(
            name="gait.stride",
            key="stride",
            label="stride",
            hint="Length of every step, cm",
            unit="cm",
            si="m",
            limits=(STRIDES[0] * stride, STRIDES[1] * stride),
            step=round(100.0 * stride / 60.0, 6),
            **_of_robot("gait.stride"),
            keys=(("F", "Shorter steps"), ("G", "Longer steps")),
            shift=True,
        ),
        Slider(
            name="speed",
            key="speed",
            label="speed",
            hint="Seconds of walking that one second shows",
            unit="",
            si="times real time",
            limits=(1.0, 20.0),
            step=0.5,
            read=lambda settings: settings.speed,
            apply=lambda settings, times: replace(settings, speed=times),
            keys=(("pagedown", "Slower"), ("pageup", "Faster")),
            factor=2.0,
        ),
    )
    return {row.name: row for row in rows}


def _of_robot(path: str) -> dict[str, Any]:
    """Functions of a slider of a number of the robot file."""
    return {
        "read": lambda settings: settings.robot.get(path),
        "apply": lambda settings, value: replace(settings, robot=settings.robot.with_value(path, value)),
    }


def _springs(file: Robot) -> list[Slider]:
    """Sliders of the first spring, of all springs together, and of each of the others."""
    own = file.springs
    low = _SOFTEST * max(own.stiffness) if own.softest is None else min(own.softest)
    high = _STIFFEST * max(own.stiffness) if own.stiffest is None else max(own.stiffest)
    step = float(f"{units.from_si(high - low, PAPER_UNIT) / 400.0:.1g}")
    look: dict[str, Any] = {"unit": PAPER_UNIT, "si": "N*m/rad", "limits": (low, high), "step": step}
    first, *others = (
        Slider(name, f"k{joint}", f"spring {joint}", f"Stiffness of joint {joint}, N·mm/deg", **look, **_of_robot(name))
        for joint, name in enumerate((f"{ALL}[{joint}]" for joint in range(len(own.stiffness))), 1)
    )
    keys = (("Z", "First spring softer"), ("X", "First spring stiffer"))
    hint = "Stiffness of joint 1 (the paper's k1), N·mm/deg"
    first = replace(first, label="first spring", hint=hint, keys=keys)
    keys = (("Z", "All springs softer"), ("X", "All springs stiffer"))
    hint = "Stiffness of all joints (their mean), N·mm/deg"
    look |= _of_robot(ALL) | {"read": lambda settings: float(np.mean(settings.robot.springs.stiffness))}
    together = Slider(ALL, "k", "all springs", hint, **look, keys=keys, shift=True)
    return [first, together, *(replace(row, folder="Each spring (N·mm/deg)") for row in others)]


def _with_friction(settings: Settings, file: Robot, factor: float) -> Settings:
    """The floor of the file, times a factor, for all engines."""
    robot = settings.robot.with_value("ground.friction", factor * file.ground.friction)
    if file.twin is not None:
        robot = robot.with_value("twin.sliding_friction", factor * file.twin.sliding_friction)
    return replace(settings, robot=robot, friction=factor)
