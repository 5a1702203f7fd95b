"""Part of a walk that the engines of chilopod share: its beginning, robots, actuators, targets and saving."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from chilopod.engine.actuators import Actuators
from chilopod.engine.arguments import as_number, as_seeds, rows_of
from chilopod.engine.contract import Observation, Traits, Walk
from chilopod.engine.saved import pack, part, read_back, unpack
from chilopod.engine.targets import Targets
from chilopod.frozen import Array
from chilopod.record import Recording, add_outcome, check_size
from chilopod.robot import Robot

if TYPE_CHECKING:
    import xarray as xr

_Kind = TypeVar("_Kind", bound="BatchWalk")

_SAME_INSTANT = 1e-9  # s


class Beginning(NamedTuple):
    """Beginning of a batch of walks: robots, states, shape (walks, n), factors on the friction of every foot, shape
    (walks, N, 2), and targets, m, shape (walks, 2), and seeds, or None for either."""

    robots: Sequence[Robot]
    states: Array
    factors: Array
    target: Array | None
    seeds: list[int] | None


def begin(
    robots: list[Robot],
    standing: Array,
    size: int,
    initial: ArrayLike | None,
    friction: ArrayLike | None,
    target: ArrayLike | None,
    seeds: Sequence[int] | None,
) -> Beginning:
    """Arguments of ``start``, see :class:`chilopod.engine.Engine`, with one row for each walk.

    ``robots`` has one robot, or one for each walk. ``standing`` is the default state, shape (1, n), and ``size`` the
    length of a state.
    """
    feet, noise = (robots[0].body.modules, 2), as_seeds(seeds)
    arguments = {"initial": (initial, (size,)), "friction": (friction, feet), "target": (target, (2,))}
    count, rows = rows_of(robots, arguments, noise)
    states, factors = rows["initial"], rows["friction"]
    states = np.tile(standing, (count, 1)) if states is None else states
    factors = np.ones((count, *feet)) if factors is None else factors
    noise = noise * count if noise and len(noise) == 1 else noise
    return Beginning(robots * count if len(robots) == 1 else robots, states, factors, rows["target"], noise)


def resumed(traits: Traits, saved: bytes, make: Callable[[Beginning, Recording | None, float], _Kind]) -> _Kind:
    """Walk that :meth:`BatchWalk.save` saved; ``make`` builds it from beginning, record and tolerance."""
    robots, settings, arrays = unpack(traits, saved)
    with read_back():
        begun = Beginning(robots, arrays["states"], arrays["factors"], None, as_seeds(settings.get("seeds")))
        record = None if settings["record"] is None else Recording(**settings["record"])
        walk = make(begun, record, as_number("tolerance", settings["tolerance"]))
        walk.restore(settings, arrays)
    return walk


def with_end(data: xr.Dataset, walk: Walk, record: Recording) -> xr.Dataset:
    """Record of a walk, changed in place: where its end is no sample, with the position and the joint angles there."""
    if walk.time - record.samples(walk.time)[-1] > _SAME_INSTANT:
        data["end_position"] = (("robot", "axis"), walk.pose()[:, :2], {"units": "m"})
        data["end_joint_angle"] = (("robot", "joint"), walk.observe().joint_angles, {"units": "rad"})
    return data


class BatchWalk(Walk):
    """Robots, actuators, targets and time of a walk; a sample of its record has ``size`` numbers."""

    def __init__(
        self, traits: Traits, begun: Beginning, record: Recording | None, tolerance: float, expected: float, size: int
    ) -> None:
        check_size(record, expected, size)
        keep = record is not None
        self.traits = traits
        self._robots, self._factors = tuple(begun.robots), begun.factors
        self._record, self._tolerance, self._time = record, tolerance, 0.0
        self._actuators = Actuators(begun.robots, keep)
        self._targets = Targets(len(begun.robots), begun.target, keep)
        self._expected_rows = int(expected * record.rate) + 2 if record else 0

    @property
    def robots(self) -> tuple[Robot, ...]:
        """Robots of the batch, one for each walk."""
        return self._robots

    @property
    def time(self) -> float:
        """Present time of the walk, s."""
        return self._time

    def save(self) -> bytes:
        settings, arrays = self._saved()
        record = None if self._record is None else asdict(self._record)
        settings |= {"record": record, "tolerance": self._tolerance, "time": self._time}
        arrays["factors"] = self._factors
        arrays |= {f"target_{name}": values for name, values in self._targets.state().items()}
        arrays |= {f"told_{name}": values for name, values in self._actuators.state().items()}
        return pack(self.traits, self._robots, settings, arrays)

    def restore(self, settings: dict[str, Any], arrays: dict[str, Any]) -> None:
        """Take over the state of a saved walk of the same robots."""
        self._time = as_number("time", settings["time"])
        self._actuators.restore(part(arrays, "told_"))
        self._targets.restore(part(arrays, "target_"))

    def __reduce__(self) -> tuple[Any, ...]:
        return resumed, (self.traits, self.save(), self._maker())

    def _maker(self) -> Any:
        """Function that builds such a walk from beginning, record and tolerance."""
        return type(self)

    def _saved(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Settings and arrays of the engine's own, ``states`` among them."""
        raise NotImplementedError

    def _observation(self, bearing: Array, distance: Array, joint_angles: Array) -> Observation:
        actuators = self._actuators
        return Observation(
            self._time, bearing, distance, joint_angles, actuators.leg_yaw.copy(), actuators.stiffness(self._time)
        )

    def _finish(self, data: xr.Dataset, times: Array, found: dict[str, Any]) -> None:
        """Add other variables, those of the actuators, outcome, target and attributes to a record of motion."""
        found = self._actuators.recorded(times) | found
        add_outcome(data, found, [each.label for each in self.status], self._targets.recorded(times))
        data.attrs = {"engine": self.traits.name, "robot": self._robots[0].to_toml(), "duration": self._time}
