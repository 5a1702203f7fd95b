"""Random sequences of all verbs of a walk, at round and crooked times, against the same walk in one piece, to the bit.

``python torture/verbs.py --engine planar --seed 7 --count 1000`` plays so many in this process, and prints each that
differs with its number; a fault in native code ends the process.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache
from random import Random
from typing import Any, NamedTuple

import numpy as np

from in_process import Place, environment
from outcomes import FoundFault, Kind, Outcome

_SEQUENCES, _QUICK = {"planar": 40, "twin": 4}, {"planar": 12, "twin": 1}
"""How many one attack plays."""

_COUNTS = {"planar": (1, 1, 1, 2, 2, 7, 33), "twin": (1, 1, 2, 2, 7, 33)}
_CYCLES = {"planar": 2.5, "twin": 1.3}
"""Longest walk, in gait cycles."""

_TWINS = 2
"""More of them walk for a tenth of that: each takes a thousand times as long as a planar robot."""

_LIMIT = 300.0  # s, for a process of its own, which compiles first


class Verbs:
    """Walks of both engines; a few in a process where every index is looked at."""

    name = "verbs"
    per_minute = 100

    def __init__(self, quick: bool = False) -> None:
        self._quick = quick

    def attack(self, chance: Random, place: Place) -> Outcome:
        """Some sequences of one engine."""
        engine = chance.choices(("planar", "twin"), (5, 1))[0]
        seed, checked = chance.randrange(1 << 30), chance.random() < 0.02 and not self._quick
        count = (_QUICK if self._quick else _SEQUENCES)[engine]
        words = f"verbs: {count} of the {engine} engine, seed {seed}"
        if checked:
            try:
                _in_a_process(engine, seed, place)
            finally:  # until then, whoever watches takes it that something is prepared
                place.tried.write_text(f"{words}, with bounds")
        else:
            place.tried.write_text(words)
            for number in range(count):
                play(engine, seed, number)
        return Outcome(Kind.ENDED)


class Told(NamedTuple):
    """What makes a walk what it is: a verb, at a time (s), and its arguments."""

    time: float
    verb: str
    arguments: tuple[Any, ...]


def play(engine: str, seed: int, number: int) -> int:
    """Play one sequence and the same walk in one piece; how many verbs that were.

    Raises
    ------
    FoundFault
        If anything differs.
    """
    chance = Random(f"{engine} {seed} {number}")
    begin, record = _beginning(engine, chance)
    walk, restartable = begin(), not record
    told: list[Told] = []
    glances: list[tuple[int, float, bytes]] = []
    verbs, end = 0, chance.uniform(0.05, 1.0) * _CYCLES[engine] * walk.robots[0].gait.period
    end *= 0.1 if engine == "twin" and len(walk.robots) > _TWINS else 1.0
    while walk.time < end and verbs < 60:
        until = _next_time(chance, walk, end)
        walk.advance(until)
        for _ in range(chance.choice((0, 1, 1, 2, 3))):
            verbs += 1
            verb = chance.choices(list(_VERBS), list(_VERBS.values()))[0]
            if verb in _LOOKS:
                seen = _LOOKS[verb](walk)
                if chance.random() < 0.3:
                    glances.append((len(told), walk.time, _VERB_BYTES[verb] + seen))
            elif verb == "resume":
                walk = _engine(engine).resume(walk.save())
            else:
                arguments = _arguments(verb, chance, walk, engine, restartable)
                if arguments is not None:
                    told.append(Told(walk.time, verb, arguments))
                    getattr(walk, verb)(*arguments)
    # A dataset takes ten times as long as all else, and shows little that is not saved.
    _compare(begin, walk, told, glances, chance.random() < 0.1, f"{engine}, seed {seed}, number {number}")
    return verbs


def _compare(
    begin: Callable[[], Any],
    walk: Any,
    told: list[Told],
    glances: list[tuple[int, float, bytes]],
    dataset: bool,
    which: str,
) -> None:
    """The same walk in one piece: told the same at the same times, and nothing else."""
    once = begin()
    for each in told:
        once.advance(each.time)
        getattr(once, each.verb)(*each.arguments)
    once.advance(walk.time)
    if once.status != walk.status:
        raise FoundFault(Kind.WRONG, f"status differs: {which}")
    for verb, look in _LOOKS.items():
        if (verb != "to_dataset" or dataset) and look(once) != look(walk):
            raise FoundFault(Kind.WRONG, f"{verb} differs: {which}")
    if glances:
        count, moment, seen = glances[-1]
        once = begin()
        for each in told[:count]:
            once.advance(each.time)
            getattr(once, each.verb)(*each.arguments)
        once.advance(moment)
        verb = next(verb for verb, mark in _VERB_BYTES.items() if seen.startswith(mark))
        if _VERB_BYTES[verb] + _LOOKS[verb](once) != seen:
            raise FoundFault(Kind.WRONG, f"{verb} at {moment!r} s differs: {which}")


def _observed(walk: Any) -> bytes:
    seen = walk.observe()
    return repr(seen.time).encode() + b"".join(
        getattr(seen, name).tobytes() for name in ("bearing", "distance", "joint_angles", "leg_yaw", "stiffness")
    )


def _recorded(walk: Any) -> bytes:
    data = walk.to_dataset()
    return b"".join(name.encode() + data[name].values.tobytes() for name in sorted(data.data_vars) if name != "status")


_LOOKS: dict[str, Callable[[Any], bytes]] = {
    "observe": _observed,
    "pose": lambda walk: walk.pose().tobytes(),
    "states": lambda walk: walk.states().tobytes(),
    "save": lambda walk: walk.save(),
    "to_dataset": _recorded,
}
_VERB_BYTES = {verb: f"{verb}:".encode() for verb in _LOOKS}
_VERBS = {
    **{"observe": 6, "pose": 3, "states": 3, "save": 0.2, "to_dataset": 0.05, "resume": 0.7},
    **{"command": 6, "aim": 2, "halt": 0.7, "restart": 4},
}
"""All verbs but ``advance``, and how often each is played."""


@cache
def _engine(name: str) -> Any:
    from chilopod.engine import engine_named

    return engine_named(name)


@cache
def _robots(engine: str) -> tuple[Any, ...]:
    """Of one gait and size, with springs that can be set, at once and with lag, and one of another friction."""
    from chilopod.robot import load_robot

    base = load_robot("aoi2022-planar" if engine == "planar" else "aoi2022").override("springs.adjustable", True)
    lagging = base.override("springs.lag", 0.05).override("springs.rate", 40.0)
    soft = base.override("springs.stiffness[0]", 1.5)
    more = (base.override("ground.friction", 100.0),) if engine == "planar" else ()
    return (base, lagging, soft, *more)


def _beginning(engine: str, chance: Random) -> tuple[Callable[[], Any], bool]:
    """What starts the walk, as often as it is called, and whether it keeps a record."""
    from chilopod.record import Recording

    robots = [chance.choice(_robots(engine)) for _ in range(chance.choice(_COUNTS[engine]))]
    record = None
    if chance.random() < 0.5:
        record = Recording(chance.choice((100.0, 33.3, 50.0, 7.0, 1000.0)), chance.random() < 0.2)
    spread = np.random.default_rng(chance.randrange(1 << 30))
    bends = spread.normal(0.0, 0.05, (len(robots), robots[0].body.modules - 1))
    options: dict[str, Any] = {"initial": _engine(engine).initial_states(robots[0], bends), "record": record}
    if chance.random() < 0.6:
        options["target"] = spread.uniform(-2.0, 2.0, (len(robots), 2))
    if chance.random() < 0.3:
        options["friction"] = spread.uniform(0.5, 2.0, (len(robots), robots[0].body.modules, 2))
    if engine == "twin" and chance.random() < 0.5:
        options["seeds"] = list(range(len(robots)))
    if chance.random() < 0.3:
        options["expected"] = 1.0
    return lambda: _engine(engine).start(robots, **options), record is not None


def _next_time(chance: Random, walk: Any, end: float) -> float:
    """From now on: round, crooked, at a switch, at a sample, beside any of them, or now."""
    now, gait = walk.time, walk.robots[0].gait
    way = chance.randrange(8)
    if way == 0:
        time = now + chance.choice((0.01, 0.1, 0.033, 0.002, 1 / 3))
    elif way == 1:
        time = round(now + 0.2 * chance.random(), chance.choice((1, 2, 3)))
    elif way == 2:
        time = (math.floor(now / gait.period) + chance.choice((1, 1, 2))) * gait.period
    elif way == 3:
        switches = gait.schedule(walk.robots[0].body.modules).times
        time = gait.period * math.floor(now / gait.period) + chance.choice(switches.tolist())
    elif way == 4:
        time = math.ceil(100.0 * now + chance.choice((0, 1, 5))) / 100.0
    elif way == 5:
        time = now
    else:
        time = now + (end - now) * chance.random()
    beside = chance.choice((0.0, 0.0, 0.0, 1e-15, -1e-15, 1e-12, -1e-12, 7e-11, -7e-11, 1.3e-10, -5e-10, 1e-9, -1.1e-9))
    time += beside
    if chance.random() < 0.2:
        time = math.nextafter(time, chance.choice((0.0, math.inf)))
    return max(now, min(time, now + end))


def _arguments(verb: str, chance: Random, walk: Any, engine: str, restartable: bool) -> tuple[Any, ...] | None:
    """For a verb that changes the walk; None where it would be refused."""
    count, robot = len(walk.robots), walk.robots[0]
    spread = np.random.default_rng(chance.randrange(1 << 30))
    if verb == "aim":
        return (spread.uniform(-2.0, 2.0, (count, 2)) if chance.random() < 0.8 else (math.nan, math.nan),)
    if verb == "halt":
        return (spread.random(count) < 0.3,)
    if verb == "command":
        return (_command(chance, spread, walk),)
    cycles = walk.time / robot.gait.period
    if not restartable or abs(cycles - round(cycles)) > 1e-9:
        return None
    which = spread.random(count) < 0.5
    bends = spread.normal(0.0, 0.05, (int(which.sum()), robot.body.modules - 1))
    initial = _engine(engine).initial_states(robot, bends if len(bends) else 0.0)
    friction = spread.uniform(0.5, 2.0, (robot.body.modules, 2)) if chance.random() < 0.3 else None
    return which, initial, friction


def _command(chance: Random, spread: np.random.Generator, walk: Any) -> Any:
    from chilopod.engine import Command

    count, joints = len(walk.robots), walk.robots[0].body.modules - 1
    told: dict[str, Any] = {"within": chance.choice((0.0, 0.0, 0.05, 0.2, 1 / 3))}
    if chance.random() < 0.6:
        told["leg_yaw"] = spread.uniform(-0.3, 0.3, (count, 2) if chance.random() < 0.5 else 2)
    if chance.random() < 0.5:
        told["stiffness"] = spread.uniform(2.0, 30.0, (count, joints))
    if chance.random() < 0.3:
        # One in a while tears the robot apart.
        size = 30.0 if chance.random() < 0.1 else 0.3
        told["joint_torque"] = spread.uniform(-size, size, (count, joints))
    return Command(**told)


def _in_a_process(engine: str, seed: int, place: Place) -> None:
    """The same where every index of compiled code is looked at, whose code is kept apart, beside the places."""
    command = [sys.executable, __file__, "--engine", engine, "--seed", str(seed), "--count", str(_SEQUENCES[engine])]
    words = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(place.root.with_name("bounds"))}
    done = subprocess.run(command, env=environment(place, **words), capture_output=True, text=True, timeout=_LIMIT)
    if done.returncode:
        kind = Kind.CRASH if done.returncode < 0 else Kind.WRONG
        raise FoundFault(kind, f"with bounds: {(done.stdout + done.stderr)[-300:]}")


def main() -> int:
    """Play, and print what differs; the exit code is 1 if anything did."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", choices=list(_SEQUENCES), default="planar")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first sequence")
    parser.add_argument("--count", type=int, default=1000)
    asked = parser.parse_args()
    begun, verbs, wrong = time.monotonic(), 0, 0
    for number in range(asked.first, asked.first + asked.count):
        try:
            verbs += play(asked.engine, asked.seed, number)
        except FoundFault as fault:
            wrong += 1
            print(fault.said, flush=True)
        if (number + 1) % 1000 == 0:
            print(f"{number + 1} sequences, {wrong} differ, {time.monotonic() - begun:.0f} s", flush=True)
    print(f"{asked.engine}, seed {asked.seed}: {asked.count} sequences, {verbs} verbs, {wrong} differ", flush=True)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
