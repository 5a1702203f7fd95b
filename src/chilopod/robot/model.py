"""The robot as validated, immutable objects in SI units and radians, and its parameters by dotted path."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import PlainValidator, model_validator

from chilopod import units
from chilopod.errors import ChilopodError, ParameterError, concerning
from chilopod.gait import Gait
from chilopod.ground import GRAVITY, Ground
from chilopod.robot.files import Table, described, parsed, read_table, to_toml
from chilopod.robot.inertia import module_yaw_inertia
from chilopod.robot.parameters import QUANTITIES, Place, place_of, spring_index
from chilopod.robot.parts import MODULES, Body, Legs, Springs, Twin, spread
from chilopod.units import Description, Flag, Quantity, quantities

_OVERRIDDEN: Final = "set by override"
_COPIED: Final = "copied from "
_LONGEST: Final = 1000  # characters of a provenance
_DERIVED: Final = "body.yaw_inertia"  # the one optional number that has a value where none is given


def _printable(text: object, longest: int) -> str:
    if not isinstance(text, str):
        raise ParameterError("must be text", value=text)
    if not (text.strip() and text.isprintable() and len(text) <= longest):
        raise ParameterError("must be plain text", value=text, allowed=f"1 to {longest} printable characters")
    return text


def _table(table: object) -> Table:
    if not isinstance(table, Mapping):
        raise ParameterError("must be a table", value=table)
    return table if isinstance(table, Table) else Table(table)


def _provenance(table: object) -> Table:
    """Read [provenance], where a key is a dotted path, quoted or not (TOML makes tables of the latter)."""
    flat: dict[str, str] = {}
    pending = deque(_table(table).items())
    while pending:
        path, text = pending.popleft()
        if isinstance(text, Mapping):
            pending.extendleft((f"{path}.{key}", item) for key, item in reversed([*text.items()]))
            continue
        with concerning(path):
            flat[path] = _printable(text, _LONGEST)
    return Table(flat)


class Robot(Description):
    """A many-legged robot with a flexible body axis, its gait and its floor; UnitError or ParameterError names the
    first field that is wrong.

    Attributes
    ----------
    name
        Printable text.
    body, springs, legs, gait, ground
        The parts of the description, in SI units and radians.
    twin
        Constants that only the three-dimensional model reads; None for a robot of the planar model alone.
    provenance
        Origin of the numbers: text by dotted path.
    """

    name: Annotated[str, PlainValidator(partial(_printable, longest=100))]
    body: Body
    springs: Springs
    legs: Legs
    gait: Gait
    ground: Ground
    twin: Twin | None = None
    provenance: Annotated[Table, PlainValidator(_provenance)] = Table()

    @classmethod
    def load(cls, robot: str | Path) -> Self:
        """Read a robot file, or a preset by its name; RobotFileError names place and fault of an invalid one."""
        return described(cls, *read_table(robot))

    @classmethod
    def from_toml(cls, text: str) -> Self:
        """Read the text that :meth:`to_toml` wrote."""
        return cls(**parsed(text))

    @model_validator(mode="before")
    @classmethod
    def _spread_springs(cls, data: Any) -> Any:
        if not (isinstance(data, Mapping) and isinstance(data.get("body"), Mapping | Body)):
            return data
        body, springs = data["body"], data.get("springs")
        if not isinstance(springs, Mapping):
            return data
        try:
            modules = body.modules if isinstance(body, Body) else MODULES.read(body.get("modules"))
        except ChilopodError:
            return data  # the field itself reports it
        return {**data, "springs": spread(springs, quantities(Springs), int(modules) - 1)}

    @model_validator(mode="after")
    def _counts_agree(self) -> Self:
        joints = self.body.modules - 1
        for key in quantities(Springs):
            values = getattr(self.springs, key)
            if values is not None and len(values) != joints:
                problem = f"must have one value for each joint, not {len(values)}"
                allowed = f"{joints}, one fewer than body.modules, or a single value for all"
                raise ParameterError(problem, field=f"springs.{key}", allowed=allowed)
        for path in self.provenance:
            with concerning(f"provenance.{path}"):
                if isinstance(self._locate(path).index, slice):
                    raise ParameterError("must be the path of one spring or of all")
        return self

    @property
    def module_length(self) -> float:
        """Length of one module, m."""
        return self.body.length / self.body.modules

    def axis_radius(self, joint_angles: ArrayLike) -> NDArray[np.float64]:
        """Radius of the arc that the body axis makes, the paper's (N-1) L / sum |theta|, m, shape (...), of mean joint
        angles, rad, shape (..., N-1): infinite where all are zero, NaN where one is."""
        angles, joints = np.asarray(joint_angles, dtype=np.float64), self.body.modules - 1
        if angles.shape[-1:] != (joints,):
            allowed = f"(..., {joints}), one for each joint"
            raise ParameterError(f"has the wrong shape {angles.shape}", field="joint_angles", allowed=allowed)
        bent = np.abs(angles).sum(-1)
        with np.errstate(divide="ignore", over="ignore"):  # a negligible bend is straight
            return np.asarray(joints * self.module_length / bent)

    @property
    def module_mass(self) -> float:
        """Mass of one module, kg."""
        return self.body.mass / self.body.modules

    @property
    def weight(self) -> float:
        """Weight of the whole robot, N."""
        return self.body.mass * GRAVITY

    @property
    def module_yaw_inertia(self) -> float:
        """Moment of inertia of one whole module with its legs about its centre, kg*m^2, see :class:`Body`."""
        return module_yaw_inertia(self.body, self.legs, self.twin)

    def parameters(self) -> tuple[str, ...]:
        """Return the path of every number of this robot, springs one by one."""
        paths: list[str] = []
        for path, quantity in QUANTITIES.items():
            section, key = path.split(".")
            if self.twin is None and section == "twin":
                continue
            if quantity.optional and path != _DERIVED and getattr(getattr(self, section), key) is None:
                continue
            count = self.body.modules - 1
            paths += [f"{path}[{index}]" for index in range(count)] if quantity.each else [path]
        return tuple(paths)

    def numbers(self, path: str) -> tuple[str, ...]:
        """Return the paths of all numbers that a path means, springs one by one."""
        place, stem = self._locate(path), path.partition("[")[0]
        return tuple(f"{stem}[{i}]" for i in place.joints(self.body.modules - 1)) if place.quantity.each else (stem,)

    def get(self, path: str) -> float:
        """Return a parameter in SI units, such as ``gait.stride`` or ``springs.stiffness[0]``. Without an index the
        springs count as one parameter, as do those of a group such as ``springs.stiffness[1:]``, which has a value if
        all are alike. ``body.yaw_inertia`` is `module_yaw_inertia` where none is given. Here and below, a path that is
        not that of a number raises ParameterError."""
        place = self._locate(path)
        if path == _DERIVED:
            return self.module_yaw_inertia
        value = getattr(getattr(self, place.section), place.key)
        if value is None:
            raise ParameterError("must be a parameter that this robot has", field=path)
        if not place.quantity.each:
            return float(value)
        chosen = place.joints(len(value))
        if any(value[joint] != value[chosen[0]] for joint in chosen):
            one = f"{path.partition('[')[0]}[{chosen[0]}]"
            raise ParameterError(f"must be one spring, such as {one}, because they differ", field=path)
        return float(value[chosen[0]])

    def unit_of(self, path: str) -> str:
        """Return the unit a parameter is written in, such as ``N*mm/deg``; empty for a count."""
        return self._locate(path).quantity.display

    def si_unit_of(self, path: str) -> str:
        """Return the SI unit of the result of `get`, such as ``N*m/rad``."""
        return self._locate(path).quantity.si

    def with_value(self, path: str, value: float) -> Self:
        """Return this robot with one parameter changed to `value` in SI units; about 20 us, for sweeps. `path` is as
        for `get`; without an index all springs are set. Changing ``body.modules`` repeats the last spring and damper
        for new joints, and drops those of removed ones; length and mass of the whole robot stay. The provenance of a
        changed parameter says that it was overridden. ParameterError if `value` is out of range."""
        return self._changed(path, lambda quantity: quantity.check(value))

    def override(self, path: str, value: object) -> Self:
        """Return this robot with one parameter changed: a number in SI units or text with its unit. Like `with_value`;
        also raises `UnitError` if the text is not a quantity or has another dimension."""
        return self._changed(path, lambda quantity: quantity.read(value))

    def set_from_text(self, assignments: Iterable[str]) -> Self:
        """Return this robot with overrides such as ``springs.stiffness[0]=12 N*mm/deg`` made in the order given."""
        robot = self
        for assignment in assignments:
            path, equals, value = assignment.partition("=")
            if not equals:
                raise ParameterError("must be an override", value=assignment, allowed="PATH=VALUE")
            robot = robot.override(path.strip(), value)
        return robot

    def with_(self, **fields: Any) -> Self:
        """Return a validated copy of this robot with whole fields replaced, such as ``name=`` or ``gait=``."""
        return type(self)(**{**dict(self), **fields})

    def with_twin_of(self, other: Robot) -> Self:
        """Return this robot with the [twin] of another, and the provenance of its numbers."""
        texts = {path: text for path, text in other.provenance.items() if path.startswith("twin.")}
        return self.with_(twin=other.twin, provenance={**self.provenance, **texts})

    def copied(self) -> Self:
        """Return this robot with provenance that names it as the origin of all but overridden and copied numbers."""
        before = f"{_COPIED}{self.name}"
        texts = {
            path: text if text == _OVERRIDDEN or text.startswith(_COPIED) else f"{before}: {text}"[:_LONGEST]
            for path, text in self.provenance.items()
        }
        rest = (path for path in self.parameters() if self.provenance_of(path) is None)
        return self.with_(provenance={**texts, **dict.fromkeys(rest, before)})

    def provenance_of(self, path: str) -> str | None:
        """Return the provenance of a parameter; a spring falls back on that of all springs."""
        found: str | None = self.provenance.get(path, self.provenance.get(path.partition("[")[0]))
        return found

    def listed(self) -> list[tuple[str, str, str]]:
        """Return path, quantity with its unit, and origin (or nothing) of every number of this robot."""
        numbers = ((path, self.get(path), self.unit_of(path)) for path in self.parameters())
        return [(path, units.format(x, unit, digits=6), self.provenance_of(path) or "") for path, x, unit in numbers]

    def _repr_svg_(self) -> str:
        # Only notebooks draw, so the drawing is imported here.
        from chilopod.robot.schematic import schematic

        return schematic(self.body, self.springs, self.legs, self.gait, self.name)

    def _repr_html_(self) -> str:
        from chilopod.notebook import block, folded, table, words

        body, gait = self.body, self.gait
        said = (
            f"{body.modules} modules, {body.length:g} m, {body.mass:g} kg; walks straight at {gait.speed:.4g} m/s, "
            f"{gait.period:g} s a step; {'planar only' if self.twin is None else 'planar and in three dimensions'}. "
            "From above, to the right; springs in N·mm/deg, feet filled where they stand at time 0."
        )
        numbers = table(("number", "value", "from"), self.listed(), most=200)
        return block(self.name, self._repr_svg_(), words(said), folded("all numbers", numbers))

    def to_toml(self) -> str:
        """Write this robot as the text of a robot file; reading it gives an equal robot, to the last bit."""
        table: dict[str, Any] = {"name": self.name}
        for path, quantity in QUANTITIES.items():
            section, key = path.split(".")
            value = getattr(getattr(self, section), key, None)
            if value is None:
                continue
            if not quantity.each:
                written = quantity.write(value)
            elif path != "springs.stiffness" and len(set(value)) == 1:
                written = quantity.write(value[0])
            else:
                written = [quantity.write(item) for item in value]
            table.setdefault(section, {})[key] = written
        if self.provenance:
            table["provenance"] = self.provenance
        return to_toml(table)

    def _locate(self, path: str) -> Place:
        place = place_of(path)
        if place.section == "twin" and self.twin is None:
            raise ParameterError("needs a table [twin], which this robot lacks", field=path)
        last = self.body.modules - 2
        if isinstance(place.index, int) and place.index > last:
            raise ParameterError("must be the index of a spring", field=path, allowed=f"0 to {last}")
        if isinstance(place.index, slice) and not (place.joints(last + 1) and (place.index.stop or 0) <= last + 1):
            allowed = f"FIRST:END of indices from 0 to {last}, END not included"
            raise ParameterError("must be a group of springs", field=path, allowed=allowed)
        return place

    def _changed(self, path: str, read: Callable[[Quantity], float]) -> Self:
        place = self._locate(path)
        try:
            return self._replaced(path, place, read(place.quantity))
        except ChilopodError as error:
            error.field = path
            raise

    def _replaced(self, path: str, place: Place, value: float) -> Self:
        # Every field is checked on its own and the counts keep, so little needs validating again.
        section: Description = getattr(self, place.section)
        old = getattr(section, place.key)
        new: Any = value
        if place.quantity.each:
            if old is None:
                if place.index is not None and not isinstance(place.quantity, Flag):
                    allowed = f"{path.partition('[')[0]} for all of them"
                    raise ParameterError("must be a parameter that this robot has", allowed=allowed)
                old = (False,) * (self.body.modules - 1)
            chosen = place.joints(len(old))
            new = tuple(value if index in chosen else item for index, item in enumerate(old))
        if new == getattr(section, place.key):
            return self
        changed = section.model_copy(update={place.key: new})
        if place.section == "twin" or place.key in ("softest", "stiffest"):
            changed = type(changed)(**dict(changed))
        changes: dict[str, Any] = {place.section: changed}
        # The provenance of single springs ends when all are set, or when their joints are gone.
        joints = 0 if place.quantity.each and place.index is None else self.body.modules - 1
        if place.quantity is MODULES:
            joints = int(value) - 1
            resized = {key: _resized(getattr(self.springs, key), joints) for key in quantities(Springs)}
            changes["springs"] = self.springs.model_copy(update=resized)
        texts = dict(self.provenance)
        if joints != self.body.modules - 1:
            texts = {name: text for name, text in texts.items() if spring_index(name, path) < joints}
        own = (path,) if place.index is None else self.numbers(path)
        changes["provenance"] = Table({**texts, **dict.fromkeys(own, _OVERRIDDEN)})
        return self.model_copy(update=changes)


def load_robot(robot: str | Path) -> Robot:
    """Read a robot file, or a preset by its name; see `Robot.load`."""
    return Robot.load(robot)


def _resized(values: tuple[float, ...] | None, count: int) -> tuple[float, ...] | None:
    return None if values is None else (values + values[-1:] * count)[:count]
