"""Data for the identification of constants: results of a robot's walks, from the paper or the user, and their files."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Final, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from chilopod import units
from chilopod.analysis.parameters import ALL, PAPER_UNIT
from chilopod.errors import AnalysisError, ChilopodError, ParameterError, RobotFileError
from chilopod.frozen import Array
from chilopod.robot import Robot
from chilopod.robot.files import described, parsed
from chilopod.robot.parameters import place_of
from chilopod.tasks.identify.constants import FreeConstants
from chilopod.text_file import read_text
from chilopod.units import Description, Quantity

_STIFFNESS: Final = Quantity("N*m/rad", PAPER_UNIT)
_SPRINGS: Final = replace(_STIFFNESS, each=True)
_LEFT: Final = 3.0  # tolerances by which the norm of a mode may differ from 1: one in 300 with standard errors
_LEAST_BEND: Final = 0.1  # rad in all, at the start of a walk


_HERE: Final = files("chilopod.tasks.identify")
TEMPLATES: Final = {name: _HERE.joinpath(f"{name}.toml").read_text(encoding="utf-8") for name in ("planar", "twin")}
"""Templates of the files that :func:`load_data` reads, by the command that fits their data."""

_RANGES: Final = tomllib.loads(TEMPLATES["twin"])["free"]
FITTED: Final = FreeConstants.read(_RANGES)
"""The constants that are fitted unless the data name others, and their ranges."""

_FRICTION: Final = ["0 N*m", "0.1 N*m"]
_MORE: Final = {"twin.yaw_friction": _FRICTION, "twin.leg_friction": _FRICTION}
WITH_FRICTION: Final = FreeConstants.read({**_RANGES, "springs.damping": ["0.005 N*m*s/rad", "0.5 N*m*s/rad"], **_MORE})
"""The same with a wider range of the damping, and with dry friction of the yaw joints and of the legs' joints."""


class CriticalMode(Description):
    """Pitchfork of a robot: critical spring k1, the interval ``between`` two springs in which it is located, N*m/rad,
    joint angles of the critical mode, front to rear, of unit norm and positive sum, shape (N-1,), and tolerances."""

    k1: Annotated[float, _STIFFNESS]
    k1_tolerance: Annotated[float, _STIFFNESS]
    between: Annotated[tuple[float, ...], _SPRINGS]
    components: Annotated[tuple[float, ...], Quantity("", "", at_least=-10.0, at_most=10.0, each=True)]
    component_tolerance: Annotated[float, Quantity("", "")]

    @model_validator(mode="after")
    def _is_a_critical_mode(self) -> Self:
        if not (len(self.between) == 2 and self.between[0] < self.k1 < self.between[1]):
            k1, *shown = (units.format(each, _STIFFNESS.display, digits=6) for each in (self.k1, *self.between))
            allowed = f"two rising springs with k1 = {k1} between them; bare numbers are in N*m/rad"
            raise ParameterError("must hold k1", field="between", value=shown, allowed=allowed)
        mode = np.array(self.components)
        norm = float(np.linalg.norm(mode))
        if abs(norm - 1.0) > max(_LEFT, mode.size**0.5) * self.component_tolerance:
            said, allowed = f"must have the norm 1, not {norm:.3g}", "cosines, one for each joint"
            raise ParameterError(said, field="components", value=self.components, allowed=allowed)
        # A mode is a direction: both signs are the same mode.
        object.__setattr__(self, "components", tuple((mode * np.sign(mode.sum() or 1.0)).tolist()))
        return self


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
                if (stiffness := _STIFFNESS.read(spring)) in found:
                    raise ParameterError("must name every spring once", value=spring)
                found[stiffness] = numbers
            except ChilopodError as error:
                error.field = f"[{spring}]{error.field or ''}"
                raise
        return found


# Without an effect on walks of the twin that nothing steers.
_ACTUATED = ("springs.softest", "springs.stiffest", "springs.rate", "springs.lag")
_UNREAD = ("ground.", "twin.scanner", "twin.pole", *_ACTUATED)
_Free = Annotated[FreeConstants, BeforeValidator(FreeConstants.read)]


class Trajectory(Description):
    """File with a recorded walk, the unit of its angles where it names none, and numbers of the robot in this walk,
    such as ``springs.stiffness[0]=8 N*mm/deg``."""

    file: str
    unit: str | None = None
    settings: tuple[str, ...] = ()


class RecordedWalks(Description):
    """Recorded walks of one robot, and the constants that are free, with their ranges."""

    free: _Free
    trajectory: Annotated[tuple[Trajectory, ...], Field(min_length=1)]


class BaseSeries(Description):
    """Walks of a robot with several first springs, to which the constants are fitted.

    Springs are in N*m/rad. A measured number is a pair: the number and its standard error. The ``onset`` of curves is
    that of a square-root fit to the bend of joint 1 at the springs of ``curved``; ``radii`` are those of the curves, m,
    and ``speeds`` those of module 1 along its way, m/s, by spring. Evaluations begin with bends that are roughly those
    of the data: all joints together ``law[0] * sqrt(1/k1 - law[1])`` rad, by default through the onset and the first
    radius, of which each joint has the share ``shape``, front to rear, shape (N-1,), by default the same.
    """

    curved: Annotated[tuple[float, ...], _SPRINGS]
    straight: Annotated[tuple[float, ...], _SPRINGS]
    onset: Annotated[tuple[float, ...], _SPRINGS]
    radii: Annotated[Mapping[float, tuple[float, float]], _Measured("m", "m")]
    speeds: Annotated[Mapping[float, tuple[float, float]], _Measured("m/s", "m/s")] = {}
    free: _Free = FITTED
    law: Annotated[tuple[float, ...], Quantity("", "", each=True)] = ()
    shape: Annotated[tuple[float, ...], Quantity("", "", each=True)] = ()

    @model_validator(mode="after")
    def _is_a_series(self) -> Self:
        for name, least in (("curved", 3), ("straight", 1), ("radii", 1)):
            springs = [*getattr(self, name)]
            if twice := next((each for each in springs if springs.count(each) > 1), 0.0):
                spring = units.format(twice, PAPER_UNIT, digits=6)
                raise ParameterError("must name every spring once", field=name, value=spring)
            if len(springs) < least:
                raise ParameterError(f"must have {least} springs or more, not {len(springs)}", field=name)
        for name, allowed in (("onset", (2,)), ("law", (0, 2))):
            if len(given := getattr(self, name)) not in allowed:
                shown = [units.format(each, PAPER_UNIT if name == "onset" else "1", digits=6) for each in given]
                raise ParameterError("must be two numbers", field=name, value=shown)
        if k1 := next((path for path in self.free.paths if path.startswith(ALL) and place_of(path).joints(1)), ""):
            raise ParameterError("must not be k1, which the walks change", field=f"free[{k1}]")
        if unread := next((path for path in self.free.paths if path.startswith(_UNREAD)), ""):
            problem, sections = "must have an effect on walks of the twin", "[body], [gait], [legs], [springs], [twin]"
            raise ParameterError(problem, field=f"free[{unread}]", allowed=f"numbers of {sections}")
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
        return np.asarray(np.maximum(bend, _LEAST_BEND)[:, None] * shape)


def load_data(path: str | Path, *kinds: type[Description]) -> Any:
    """Read a TOML file of data of one of some kinds, see :data:`TEMPLATES`; RobotFileError names the fault."""
    table, source = parsed(read_text(path, "file of data", RobotFileError), str(path)), str(path)
    known: list[type[Description]] = [*kinds, CriticalMode, RecordedWalks, BaseSeries]  # of kinds alike, the first
    kind = max(known, key=lambda kind: len({*kind.model_fields} & {*table}))
    for other in known[: len(kinds)]:
        of_both = ({*other.model_fields} & {*table}) - {*kind.model_fields}
        if kind in kinds and of_both:
            said = f"belongs to other data than {', '.join(sorted({*kind.model_fields} & {*table}))}: give one kind"
            raise RobotFileError(said, source=source, field=sorted(of_both)[0])
    if kind not in kinds:
        command = "twin" if kind is BaseSeries else "planar"
        raise RobotFileError(f"has the data of `chilopod identify {command}`, which is another command", source=source)
    return described(kind, table, source)
