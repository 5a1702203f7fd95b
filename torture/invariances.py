"""What must not matter: units, scales, left and right; and errors that are within the bounds that are claimed."""

from __future__ import annotations

import sys
from decimal import Decimal
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from in_process import Place
from outcomes import FoundFault, Kind, Outcome
from some_robots import some_robot, spread

sys.path.append(str(Path(__file__).parent.parent / "benchmarks"))
_PEER_ROUNDING = 1e-12  # of the other computation, which is in double precision at its end


class Invariances:
    """A robot at random, computed in two ways."""

    name = "invariances"
    per_minute = 200

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One comparison."""
        way = chance.choice((_units, _scales, _mirror, _mirrored_walk, _bounds, _bounds, _halves, _pitchfork))
        place.tried.write_text(f"invariance: {way.__name__[1:]}")
        way(chance)
        return Outcome(Kind.ENDED)


def _multipliers(robot: Any) -> Any:
    from chilopod import stability
    from chilopod.planar import PlanarModel

    return stability.multipliers(PlanarModel(robot))


def _matched(found: Any, others: Any, within: float, what: str) -> None:
    """Make sure that every multiplier is among others, each taken once."""
    rest = list(others)
    for value in found:
        nearest = min(range(len(rest)), key=lambda index: abs(rest[index] - value))
        if abs(rest[nearest] - value) > within:
            raise FoundFault(Kind.WRONG, f"{what}: {value} is {rest[nearest]} there, and the bound is {within:.1e}")
        rest.pop(nearest)


_UNITS = {
    "body.length": {"m": 0, "cm": 2, "mm": 3, "km": -3},
    "body.mass": {"kg": 0, "g": 3},
    "gait.stance": {"s": 0, "ms": 3, "us": 6},
    "ground.friction": {"N*s/m": 0, "N*s/mm": -3, "kN*s/m": -3, "kg/s": 0, "g/ms": 0},
    "springs.stiffness[1]": {"N*m/rad": 0, "N*mm/rad": 3, "J/rad": 0, "kg*m^2/(s^2*rad)": 0},
    "legs.half_width": {"m": 0, "mm": 3, "um": 6},
}


def _units(chance: Random) -> None:
    path = chance.choice(tuple(_UNITS))
    robot = some_robot(chance).with_value("body.modules", 6)
    number = Decimal(f"{spread(chance, 0.5, 2.0):.{chance.randrange(1, 17)}g}")
    read = {
        unit: robot.set_from_text([f"{path}={number.scaleb(power)} {unit}"]).get(path)
        for unit, power in _UNITS[path].items()
    }
    if len(set(read.values())) != 1 or {*read.values()} != {float(number)}:
        raise FoundFault(Kind.WRONG, f"{path} = {number} is read as {read}")


def _scales(chance: Random) -> None:
    robot = some_robot(chance)
    mass, length, time = (spread(chance, 1.0, 10.0) for _ in range(3))
    sizes = {
        "body.mass": mass,
        "body.length": length,
        "springs.stiffness": mass * length**2 / time**2,
        "springs.damping": mass * length**2 / time,
        "legs.forward_offset": length,
        "legs.half_width": length,
        "gait.stride": length,
        "gait.stance": time,
        "gait.swing": time,
        "ground.friction": mass / time,
    }
    scaled = robot
    for path, size in sizes.items():
        each = [f"{path}[{joint}]" for joint in range(robot.body.modules - 1)] if "springs" in path else [path]
        for one in each:
            scaled = scaled.with_value(one, robot.get(one) * size)
    here, there = _multipliers(robot), _multipliers(scaled)
    within = here.error_bound + there.error_bound + _PEER_ROUNDING
    _matched(here.values, there.values, within, "in other units of mass, length and time")


def _mirror(chance: Random) -> None:
    robot = some_robot(chance).with_value("gait.side_phase", chance.uniform(0.0, 2.0 * np.pi))
    other = robot.with_value("gait.side_phase", 2.0 * np.pi - robot.gait.side_phase)
    here, there = _multipliers(robot), _multipliers(other)
    # What they are at begins elsewhere in the period, which multipliers do not know.
    within = here.error_bound + there.error_bound + 1e-9
    _matched(here.values, there.values, within, "left and right exchanged")


def _mirrored_walk(chance: Random) -> None:
    from chilopod.planar import initial_states, simulate

    robot = some_robot(chance).with_value("gait.side_phase", 0.0)
    angles = np.array([chance.uniform(-0.1, 0.1) for _ in range(robot.body.modules - 1)])
    right, left = (
        simulate(robot, 2.0, initial=initial_states(robot, sign * angles[None, :], np.zeros(1)), rate=10.0)
        for sign in (1.0, -1.0)
    )
    for name, signs in (("position", np.array([1.0, -1.0])), ("heading", -1.0), ("joint_angle", -1.0)):
        error = np.abs(right[name].values - signs * left[name].values).max()
        if not error < 1e-8:
            raise FoundFault(Kind.WRONG, f"{name} of the mirrored walk differs by {error}")


def _peer(robot: Any) -> Any:
    import peer_model

    return peer_model.PeerRobot(
        modules=robot.body.modules,
        length=robot.body.length,
        mass=robot.body.mass,
        stiffness=robot.springs.stiffness,
        damping=robot.springs.damping,
        forward_offset=robot.legs.forward_offset,
        half_width=robot.legs.half_width,
        stride=robot.gait.stride,
        stance=robot.gait.stance,
        swing=robot.gait.swing,
        friction=robot.ground.friction,
    )


def _bounds(chance: Random) -> None:
    import peer_model

    robot = some_robot(chance)
    found = _multipliers(robot)
    others = peer_model.multipliers(_peer(robot))
    _matched(found.values, others, found.error_bound + _PEER_ROUNDING, "by another program")


def _halves(chance: Random) -> None:
    found = _multipliers(some_robot(chance))
    if found.half_period is None:
        raise FoundFault(Kind.WRONG, "no multipliers of half a period")
    within = 2.0 * found.error_bound * max(1.0, np.abs(found.half_period).max()) + 1e-14
    _matched(found.values, found.half_period**2, within, "squares of those of half a period")


def _pitchfork(chance: Random) -> None:
    """At every pitchfork that is found, a multiplier of half a period is -1 by another program, too."""
    from chilopod.analysis import bifurcations

    import peer_model

    robot = some_robot(chance)
    for each in bifurcations(robot, "springs.stiffness[0]", (0.2, 3.0), seconds=20.0):
        there = robot.with_value("springs.stiffness[0]", each.point.value)
        moduli = np.abs(np.linalg.eigvals(peer_model.half_period_map(_peer(there))))
        if not np.abs(moduli - 1.0).min() < 1e-8:
            raise FoundFault(Kind.WRONG, f"at {each.point.value}, no multiplier is on the circle: {moduli}")
