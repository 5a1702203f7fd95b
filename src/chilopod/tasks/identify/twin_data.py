"""Data for the identification of the three-dimensional robot: results of walks with several first springs."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final, Self

import numpy as np
from pydantic import BeforeValidator, model_validator

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.errors import AnalysisError, ChilopodError, ParameterError
from chilopod.frozen import Array
from chilopod.robot import Robot
from chilopod.robot.files import read_file
from chilopod.tasks.identify.twin_constants import FreeConstants
from chilopod.units import Description, Quantity

_STIFFNESS: Final = Quantity("N*m/rad", PAPER_UNIT)
_SPRINGS: Final = replace(_STIFFNESS, each=True)
_LEAST_BEND: Final = 0.1  # rad in all, at the start of a walk

TWIN_TEMPLATE: Final = """\
# Data for `chilopod identify twin ROBOT --data FILE`: walks of your robot with several first springs k1. These are the
# numbers of Aoi et al. (2022). Measured numbers come in pairs: the number, and its standard error.
curved = ["28 N*mm/deg", "21 N*mm/deg", "17 N*mm/deg", "15 N*mm/deg"]     # k1 at which it curves, three or more
straight = ["41 N*mm/deg", "75 N*mm/deg"]     # k1 at which it walks straight
onset = ["34 N*mm/deg", "1.7 N*mm/deg"]     # by a square-root fit to the bend of joint 1 at the springs above

[radii]     # of the curve, by k1
"21 N*mm/deg" = ["0.88 m", "0.044 m"]
"26 N*mm/deg" = ["1.2 m", "0.06 m"]

[speeds]     # of module 1 along its way, by k1
"21 N*mm/deg" = ["0.056 m/s", "0.0028 m/s"]

[free]     # constants that you do not know, or ratios of them, and their ranges
"legs.forward_offset" = ["20 mm", "70 mm"]
"legs.half_width" = ["50 mm", "100 mm"]
"springs.damping" = ["0.005 N*m*s/rad", "0.1 N*m*s/rad"]
"twin.sliding_friction" = [0.3, 1]
"twin.servo_stiffness" = ["3 N*m/rad", "20 N*m/rad"]
"twin.clearance" = ["3 mm", "15 mm"]
"twin.joint_inertia" = ["0.0005 kg*m^2", "0.004 kg*m^2"]
"twin.impedance_ratio" = [1, 30]
"twin.servo_damping/twin.servo_stiffness" = ["0.02 s", "0.15 s"]
"""
"""Template of the file that :meth:`BaseSeries.load` reads."""

FREE: Final = FreeConstants.read(tomllib.loads(TWIN_TEMPLATE)["free"])
"""The constants that are fitted unless the data name others, and their ranges."""


@dataclass(frozen=True, slots=True)
class _Measured(Quantity):
    """A field of numbers with their standard errors, by spring: {N*m/rad: (number, error)}."""

    def read_field(self, value: object) -> Any:
        """Read a table of pairs."""
        if not isinstance(value, Mapping):
            raise ParameterError("must be a table of springs, each with a number and its standard error", value=value)
        found: dict[float, tuple[float, float]] = {}
        for spring, pair in value.items():
            try:
                numbers = replace(Quantity(self.si, self.display), each=True).read_field(pair)
                if len(numbers) != 2:
                    raise ParameterError("must be a number and its standard error", value=pair)
                found[_STIFFNESS.read(spring)] = numbers
            except ChilopodError as error:
                error.field = f"[{spring}]{error.field or ''}"
                raise
        return found


class BaseSeries(Description):
    """Walks of a robot with several first springs, to which the constants are fitted.

    Springs are in N*m/rad. A measured number is a pair: the number and its standard error.

    Attributes
    ----------
    curved, straight
        Springs at which the robot curves, and at which it walks straight.
    onset
        Spring at the onset of curves, by a square-root fit to the bend of joint 1 at the springs of ``curved``.
    radii, speeds
        Radius of the curve (m), and speed of module 1 along its way (m/s), by spring.
    free
        Constants that are fitted, and their ranges.
    law, shape
        Bends at the start of evaluations, roughly those of the data: all joints together ``law[0] * sqrt(1/k1 -
        law[1])`` rad, by default through the onset and the first radius, of which each joint has the share ``shape``,
        front to rear, (N-1,), by default the same.
    """

    curved: Annotated[tuple[float, ...], _SPRINGS]
    straight: Annotated[tuple[float, ...], _SPRINGS]
    onset: Annotated[tuple[float, ...], _SPRINGS]
    radii: Annotated[Mapping[float, tuple[float, float]], _Measured("m", "m")]
    speeds: Annotated[Mapping[float, tuple[float, float]], _Measured("m/s", "m/s")] = {}
    free: Annotated[FreeConstants, BeforeValidator(FreeConstants.read)] = FREE
    law: Annotated[tuple[float, ...], Quantity("", "", each=True)] = ()
    shape: Annotated[tuple[float, ...], Quantity("", "", each=True)] = ()

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a TOML file of the data, see :data:`TWIN_TEMPLATE`; RobotFileError, in one line, names the fault."""
        return read_file(cls, path, "file of data")

    @model_validator(mode="after")
    def _is_a_series(self) -> Self:
        for name, least in (("curved", 3), ("straight", 1), ("radii", 1)):
            if len(set(getattr(self, name))) < least:
                raise ParameterError(f"must have {least} springs or more", field=name, value=len(getattr(self, name)))
        for name, allowed in (("onset", (2,)), ("law", (0, 2))):
            if len(getattr(self, name)) not in allowed:
                raise ParameterError("must be two numbers", field=name, value=getattr(self, name))
        softer, onset, stiffer = max(*self.curved, *self.radii), self.onset[0], min(self.straight)
        if not softer < onset < stiffer:
            shown = [units.format(each, PAPER_UNIT, digits=4) for each in (softer, onset, stiffer)]
            problem = f"must lie above all springs of curves ({shown[0]}) and below all straight ones ({shown[2]})"
            raise ParameterError(problem, field="onset", value=shown[1])
        return self

    @property
    def springs(self) -> tuple[float, ...]:
        """Springs of all walks that an evaluation runs, rising."""
        return tuple(sorted({*self.curved, *self.straight, *self.radii, *self.speeds}))

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each of the residuals."""

        def at(what: str, springs: Sequence[float]) -> list[str]:
            return [f"{what} at {units.from_si(spring, PAPER_UNIT):.6g}" for spring in springs]

        radii, speeds = at("radius", tuple(self.radii)), at("speed", tuple(self.speeds))
        return *radii, *speeds, "onset", *at("straight", self.straight), *at("curved", [max(self.curved)]), "steady"

    def start(self, robot: Robot, springs: Sequence[float]) -> Array:
        """Joint angles at the start of the walks, rad, shape (springs, N-1)."""
        joints = robot.body.modules - 1
        shape = np.array(self.shape or [1.0 / joints] * joints)
        if len(shape) != joints:
            problem = f"must be {joints} numbers, one for each joint of {robot.name}"
            raise AnalysisError(problem, field="data shape", value=self.shape)
        law = self.law
        if not law:
            (spring, (radius, _)), *_ = self.radii.items()
            point = 1.0 / self.onset[0]
            law = joints * robot.module_length / radius / np.sqrt(1.0 / spring - point), point
        bend = law[0] * np.sqrt(np.maximum(1.0 / np.array(springs) - law[1], 0.0))
        angles: Array = np.maximum(bend, _LEAST_BEND)[:, None] * shape
        return angles
