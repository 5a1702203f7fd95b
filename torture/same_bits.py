"""The same walk alone and in batches, at once and in steps, at any number of threads, in another process: same bits."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from random import Random

import xarray as xr

from in_process import Place, called, environment
from outcomes import FoundFault, Kind, Outcome
from processes import commanded
from some_robots import some_robot

_THREADS = 7


class SameBits:
    """Walks of both engines, and multipliers of many robots."""

    name = "same-bits"
    per_minute = 120

    def __init__(self) -> None:
        if "numba" not in sys.modules:  # which reads it once
            os.environ.setdefault("NUMBA_NUM_THREADS", str(_THREADS))

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One comparison."""
        way = chance.choices((_batches, _steps, _threads, _seeds, _sweep, _processes), (8, 5, 5, 4, 4, 1))[0]
        place.tried.write_text(f"same bits: {way.__name__[1:]}")
        way(chance, place)
        return Outcome(Kind.ENDED)


def same(one: xr.Dataset, other: xr.Dataset, what: str) -> None:
    """Make sure that two records are one to the last bit."""
    for name in {*one.variables, *other.variables}:
        here, there = (each[name].values if name in each.variables else None for each in (one, other))
        if here is None or there is None or here.dtype != there.dtype or here.tobytes() != there.tobytes():
            raise FoundFault(Kind.WRONG, f"{name} differs: {what}")
    if one.attrs != other.attrs:
        raise FoundFault(Kind.WRONG, f"attributes differ: {what}")


def _trials(chance: Random, count: int) -> list:
    from chilopod.steering import LegYawController, Target
    from chilopod.trials import Trial

    twin = chance.random() < 0.2
    duration = chance.uniform(0.02, 0.06) if twin else chance.uniform(0.1, 3.0)
    base = Trial(
        some_robot(chance, "aoi2022" if twin else "aoi2022-planar"),
        duration,
        engine="twin" if twin else "planar",
        rate=chance.choice((10.0, 33.3, 100.0)),
        forces=chance.random() < 0.3,
    )
    if chance.random() < 0.4:
        base = replace(base, target=Target(chance.uniform(-1.0, 1.0), 2.0), controller=LegYawController())
    springs = [base.robot.with_value("springs.stiffness[0]", 0.5 + index) for index in range(count)]
    return [replace(base, robot=robot, seed=chance.randrange(1000)) for robot in springs]


def _batches(chance: Random, place: Place) -> None:
    from chilopod.trials.batch import walked

    trials = _trials(chance, chance.choice((2, 3, 5, 50)) if chance.random() < 0.9 else 1)
    together = walked(trials)
    order = list(range(len(trials)))
    chance.shuffle(order)
    size = chance.choice((1, 3, 7))
    for first in range(0, min(len(order), 4 * size), size):
        some = order[first : first + size]
        for index, record in zip(some, walked([trials[index] for index in some]), strict=True):
            same(record, together[index], f"{len(trials)} walks at once, and {len(some)} of them")


def _started(trial, threads: int = 0):
    from chilopod.engine import engine_named
    from chilopod.record import Recording

    engine = engine_named(trial.engine)
    more = {"threads": threads} if trial.engine == "twin" else {}
    return engine, engine.start([trial.robot], record=Recording(trial.rate, trial.forces), **more)


def _steps(chance: Random, place: Place) -> None:
    (trial,) = _trials(chance, 1)
    engine, once = _started(trial)
    once.advance(trial.duration)
    _, often = _started(trial)
    for _ in range(chance.randrange(1, 40)):
        often.advance(chance.uniform(often.time, min(trial.duration, often.time + 0.2 * trial.duration)))
        if chance.random() < 0.2:
            often = engine.resume(often.save())
    often.advance(trial.duration)
    same(once.to_dataset(), often.to_dataset(), "at once, and in steps with rests")


def _threads(chance: Random, place: Place) -> None:
    import numba

    from chilopod.trials.batch import walked
    from chilopod.twin import simulate as walk_twin

    trials = _trials(chance, 6)
    most = numba.config.NUMBA_NUM_THREADS
    records: list[Sequence[xr.Dataset]] = []
    for threads in (1, 2, most):
        numba.set_num_threads(min(threads, most))
        try:
            if trials[0].engine == "twin":
                robots = [trial.robot for trial in trials]
                records.append([walk_twin(robots, trials[0].duration, threads=threads)])
            else:
                records.append(walked(trials))
        finally:
            numba.set_num_threads(most)
    for others in records[1:]:
        for one, other in zip(records[0], others, strict=True):
            same(one, other, "one thread, and more")


def _seeds(chance: Random, place: Place) -> None:
    from chilopod.tasks import walk

    (trial,) = _trials(chance, 1)
    many = chance.randrange(2, 6)
    robot, told = trial.robot, {"engine": trial.engine, "rate": trial.rate}
    all_of_them = walk(robot, trial.duration, seed=5, repeats=many, **told).record
    last = walk(robot, trial.duration, seed=5 + many - 1, **told).record
    one = all_of_them.isel(robot=slice(many - 1, many)).assign_coords(robot=[0])
    one.attrs = last.attrs  # it is named after the first
    same(one, last, f"the last of {many} seeds, and that seed alone")


def _sweep(chance: Random, place: Place) -> None:
    from chilopod import stability
    from chilopod.planar import PlanarModel

    models = [PlanarModel(some_robot(chance)) for _ in range(chance.randrange(2, 5))]
    for model, found in zip(models, stability.sweep(models), strict=True):
        alone = stability.multipliers(PlanarModel(model.robot))
        if alone.values.tobytes() != found.values.tobytes() or alone.error_bound != found.error_bound:
            raise FoundFault(Kind.WRONG, "multipliers alone, and in a sweep")


def _processes(chance: Random, place: Place) -> None:
    command = chance.choice(
        (
            ("walk", "aoi2022-planar", "--duration", "2 s", "--seed", "3", "--repeats", "4", "--json"),
            ("walk", "aoi2022", "--engine", "twin", "--duration", "0.1 s", "--seed", "3", "--repeats", "3", "--json"),
            ("stability", "aoi2022-planar", "--json"),
        )
    )
    threads = chance.choice(("1", "2", "7"))
    place.tried.write_text(f"chilopod {' '.join(command)} here, and in a process with NUMBA_NUM_THREADS={threads}")
    here, there = called(command, place), commanded(command, place, env=environment(place, NUMBA_NUM_THREADS=threads))
    if here.code or here.out != there.out:
        raise FoundFault(Kind.WRONG, f"another process: {there.err[-200:]}")
