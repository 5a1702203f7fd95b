"""Batches of trials that one engine walks together, and executors, which run them."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import replace
from itertools import chain
from typing import Any, Protocol

import numpy as np
import xarray as xr

from chilopod.cores import cores
from chilopod.engine import Command, Event, Observation, Walk, engine_named, event_times, steer
from chilopod.engine.batch import with_end
from chilopod.engine.loop import Heard
from chilopod.errors import AnalysisError, ChilopodError
from chilopod.progress import Progress, silent
from chilopod.record import load_xarray
from chilopod.steering import CourseReferee, Target, add_measures
from chilopod.steering.measures import lengths
from chilopod.trials.description import DIGITS, classes_in, file_text, is_ours, plain
from chilopod.trials.record_check import check_record
from chilopod.trials.trial import Drawn, Trial, conditions, draw

NOT_KEPT = "not kept"
"""Attribute with the reason why a record must not be kept; files never have it."""

_OTHERWISE = 0.05  # joint angles of robots beside one that starts straight, rad
_CHANGES = "an object that its code can reach changes while it steers"
_VARIES = "equal observations give different commands (a clock, random numbers without a seed, a counter?)"
_MOST_AGAIN = 100_000  # observations of single robots that a controller is shown twice: some 20 MB
_KNOWN: dict[str, str] = {}  # findings about controllers, by everything that defines them
_MOST_BYTES = 256e6
"""Approximate largest size of the records of a batch, bytes."""
_SECONDS = 2.5  # of work in a batch, about
_USUAL = 10.0  # s of a walk of which a core walks the engine's ``robots_per_core``, until measured
_LANES = 8  # robots that a core walks at once in the planar model


def batches(trials: Sequence[Trial], on_cores: int | None = None) -> list[list[Trial]]:
    """Group trials, in any order, into batches that can walk together and take a few seconds, within a limit of memory
    and on a number of cores each, by default all."""
    groups: dict[tuple[Any, ...], list[Trial]] = {}
    for trial in trials:
        walks = trial.engine, engine_named(trial.engine).common(trial.robot), trial.robot.gait, trial.robot.body.modules
        course = trial.course
        sight = (course.patience, course.view, course.range, course.tightest) if course else trial.target is None
        asked = trial.duration, trial.recording, trial.brief, sight
        noisy = trial.disturbance.bearing > 0.0  # reported once for a batch
        springs = any(trial.robot.springs.adjustable or ())  # over time in the records of all, if any is adjustable
        alike = walks, asked, noisy, springs, json.dumps(trial.steering, sort_keys=True), trial.code
        groups.setdefault(alike, []).append(trial)
    split = []
    for group in groups.values():
        robots_per_core = engine_named(group[0].engine).traits.robots_per_core
        size = max(1, min(robots_per_core * (on_cores or cores()), int(_MOST_BYTES / _bytes_of(group[0]))))
        split += [group[i : i + size] for i in range(0, len(group), size)]
    return split


def walked(trials: Sequence[Trial]) -> list[xr.Dataset]:
    """Records of the trials of one of :func:`batches`, each with one ``robot``, and robot file and trial in the
    attributes. Raises ParameterError or AnalysisError if an argument is out of range or a controller fails.

    Every thread walks its part of the trials, unless their controller is a user's, which may not expect threads. The
    results do not depend on the number of threads.
    """
    if not engine_named(trials[0].engine).traits.threads or _is_own(trials[0]):
        return _walked(trials)
    import numba  # takes half a second to load

    threads = min(numba.get_num_threads(), len(trials) // _LANES)
    if threads < 2:
        return _walked(trials)
    load_xarray()
    stopped = threading.Event()

    def go_on(done: float, words: str) -> None:
        if stopped.is_set():
            raise AnalysisError("was stopped", field="walk")

    def part(number: int) -> list[xr.Dataset]:
        numba.set_num_threads(1)  # of this thread
        return _walked(trials[number * len(trials) // threads : (number + 1) * len(trials) // threads], go_on)

    with ThreadPoolExecutor(threads) as pool:
        parts = [pool.submit(part, number) for number in range(threads)]
        try:
            done, _ = wait(parts, return_when=FIRST_EXCEPTION)
            failed = [each for each in done if each.exception()]
            return list(chain.from_iterable(each.result() for each in failed or parts))
        finally:
            stopped.set()


def _walked(trials: Sequence[Trial], progress: Progress = silent) -> list[xr.Dataset]:
    """Records as of :func:`walked`, of trials that walk together in this thread."""
    first = trials[0]
    # A controller that is not reproducible is found before.
    doubts = first.code[1] or first.code[2] or _doubts(first)
    asked: list[tuple[Event, Observation, list[bytes | None]]] = []

    def heard(event: Event, seen: Observation, command: Command) -> None:
        if len(asked) * len(trials) < _MOST_AGAIN:
            asked.append((event, seen, _bits(command)))

    doubtful = not doubts and _is_own(first)
    walk, drawn, referee = _steered(trials, first.duration, progress, heard if doubtful else None)
    name = type(first.controller).__name__
    if first.controller is not None and json.dumps(plain(first.controller, name)) != json.dumps(first.steering):
        raise AnalysisError("must not change its own fields while it steers: they name the trial", field=name)
    if doubtful:
        doubts = _KNOWN[_who(first)] = _CHANGES if _changed(first) else _varies(first.controller, asked)
    data = check_record(walk.to_dataset(), walk, trials, drawn)
    if referee is None:
        with_end(data, walk, first.recording)
    else:
        referee.add_to(data, walk)
        add_measures(data, first.robot.gait.period)
    return _apart(data.assign_attrs({NOT_KEPT: doubts} if doubts else {}), trials)


def _steered(
    trials: Sequence[Trial], until: float, progress: Progress = silent, heard: Heard | None = None
) -> tuple[Walk, list[Drawn], CourseReferee | None]:
    """Walk trials of one batch up to a time, s; return their walk, the drawn disturbances and the referee."""
    first = trials[0]
    engine = engine_named(first.engine)
    targets = [each.target.position for each in trials if isinstance(each.target, Target)]
    courses = [each.course for each in trials if each.course]
    asked = sum(1 for _ in event_times(first.controller, first.robot.gait, first.duration)) if first.controller else 0
    drawn = [draw(each.disturbance, each.seed, each.robot.body.modules, asked, each.joint_angles) for each in trials]
    walk = engine.start(
        [trial.robot for trial in trials],
        target=np.stack(targets) if targets else None,
        record=first.recording,
        expected=first.duration,
        **conditions(engine, first.robot, drawn, first.target is not None and first.disturbance.bearing > 0.0),
    )
    if len(walk.robots) != len(trials):
        problem = f"start must return a walk of {len(trials)} robots, not {len(walk.robots)}"
        raise AnalysisError(problem, field=f"engine {first.engine}")
    noise = None if engine.traits.noisy or not asked else np.stack([each.bearing for each in drawn])
    missed = np.stack([each.missed for each in drawn])
    referee = CourseReferee(courses, first.robot.gait, missed) if courses else None
    steer(walk, until, first.controller, bearing_noise=noise, referee=referee, progress=progress, heard=heard)
    return walk, drawn, referee


def _is_own(trial: Trial) -> bool:
    return trial.controller is not None and not all(is_ours(kind) for kind in classes_in(trial.controller))


def _who(trial: Trial) -> str:
    return json.dumps([trial.steering, trial.code, trial.engine])


def _varies(controller: Any, asked: Sequence[tuple[Event, Observation, list[bytes | None]]]) -> str:
    """Finding if a controller commands anything else, or fails, when it is shown the same once more; else empty."""
    with suppress(Exception):
        return _VARIES * any(_bits(controller.act(event, shown)) != bits for event, shown, bits in asked)
    return _VARIES


def _bits(command: Command) -> list[bytes | None]:
    return [None if each is None else np.asarray(each, float).tobytes() for each in vars(command).values()]


def _changed(trial: Trial) -> bool:
    """True if the code of a controller reaches other objects than before."""
    # Behind it is the engine's code, which may fill a cache: equal arguments give equal walks, as engines promise.
    return trial.as_now().code[0][:DIGITS] != trial.code[0][:DIGITS]


def _doubts(trial: Trial) -> str:
    """Reason why a controller's walks are not reproducible, if so."""
    who = _who(trial)
    if _is_own(trial) and who not in _KNOWN:
        _KNOWN[who] = _found_doubts(trial)
    return _KNOWN.get(who, "")


def _found_doubts(trial: Trial) -> str:
    """Reason from the first gait cycle, walked twice, once in each process, and among other robots."""
    cycle = min(trial.robot.gait.period, trial.duration)
    beside = replace(trial, seed=trial.seed + 1, joint_angles=() if any(trial.joint_angles) else (_OTHERWISE,))
    if isinstance(trial.target, Target):
        beside = replace(beside, target=Target(-0.5 * trial.target.bearing, trial.target.distance))
    one, other = (_steered([trial], cycle)[0].to_dataset() for _ in range(2))
    try:
        among = _steered([beside, trial, beside], cycle)[0].to_dataset()
    except ChilopodError as error:  # of a controller for one robot alone
        return f"it fails among other robots ({error.problem})"
    # An engine may return anything.
    if not getattr(one, "identical", lambda _: True)(other):
        return _VARIES
    if not _same_bits(one, among):
        return "commands depend on other robots of the batch"
    return _CHANGES if _changed(trial) else ""


def _same_bits(alone: xr.Dataset, among: xr.Dataset) -> bool:
    """True if a robot walks alone as it does as the second of three, or an engine's records are not of so many."""
    one, other = (getattr(each, "joint_angle", None) for each in (alone, among))
    if [getattr(each, "sizes", {}).get("robot") for each in (one, other)] != [1, 3]:
        return True
    return np.array_equal(one.isel(robot=0), other.isel(robot=1), equal_nan=True)  # type: ignore[union-attr]


def _apart(data: xr.Dataset, trials: Sequence[Trial]) -> list[xr.Dataset]:
    """Records of single robots, each up to the end of its course."""
    counts = lengths(data) if trials[0].course else {}
    ends = np.nanmax(data.goal_end.values, axis=1) if counts else np.full(len(trials), data.attrs["duration"])
    if trials[0].brief:
        data, counts = data.drop_dims(["time", "event"], errors="ignore"), {}
    # Numbering each robot 0 afterwards would take longer than everything else.
    data = data.assign_coords(robot=np.zeros(len(trials), dtype=np.int64))
    records = []
    for index, trial in enumerate(trials):
        own = {"robot": slice(index, index + 1), **{name: slice(count[index]) for name, count in counts.items()}}
        record = data.isel(own, missing_dims="ignore")
        if counts and not record.sizes.get("event", 1):
            record = record.drop_dims("event")  # alone it was asked for no command
        if counts and "target" in record and np.isnan(record.target.values).all():
            record = record.drop_vars(["target", "distance", "bearing"])
        # Numbers that lie otherwise in memory are added up in another order: sums have the same bits whether a walk was
        # one of many, alone, or read.
        for each in map(record.variables.__getitem__, record.data_vars):
            if not each.values.flags.c_contiguous:
                each.data = np.ascontiguousarray(each.values)
        record.attrs |= {"duration": float(ends[index]), "robot": file_text(trial.robot), "trial": trial.text}
        records.append(record)
    return records


def _bytes_of(trial: Trial) -> float:
    """Approximate memory of a trial's record while it walks, bytes."""
    # A module's joint, legs and servos at every sample, as the engine has them and as they are recorded.
    numbers = (20 + 6 * trial.forces + 8 * trial.poses) * trial.robot.body.modules
    return 8.0 * numbers * (trial.duration * trial.rate + 1.0)


class Executor(Protocol):
    """Executor of batches of trials; results are equal to the bit on every executor."""

    @property
    def words(self) -> str:
        """Name of the place, to be put behind "3 of 7 trials"; empty on this machine alone."""
        ...

    def cut(self, batches: Sequence[list[Trial]]) -> Iterable[list[Trial]]:
        """Yield the same batches in order, large ones in pieces; each is cut when it is taken."""
        ...

    def walk(self, batches: Iterable[Sequence[Trial]]) -> Iterator[tuple[int, list[xr.Dataset]]]:
        """Yield the number and the records of every batch as soon as it is done, in any order. A batch is taken when
        its walk begins, so that other processes may take those not yet begun. The walks stop when the generator is
        closed."""
        ...


class Pace:
    """Estimate of the trials in a few seconds of work from the time of the last ones; a kill loses the current
    batch."""

    def __init__(self) -> None:
        self._speeds: dict[str, float] = {}  # of engines: s of walks that a core does in a second

    def pieces(self, batch: Sequence[Trial], threads: int) -> Iterator[list[Trial]]:
        """Yield a batch in pieces for a number of threads, each cut when it is taken: all lanes full, or at least all
        threads busy."""
        done = 0
        while done < len(batch):
            first = batch[done]
            usual = engine_named(first.engine).traits.robots_per_core * _USUAL / _SECONDS
            speed = self._speeds.get(first.engine, usual)
            most = int(threads * speed * _SECONDS / first.duration)
            unit = threads * _LANES if most >= threads * _LANES else threads
            size = max(threads, most // unit * unit)
            yield list(batch[done : done + size])
            done += size

    def took(self, batch: Sequence[Trial], threads: int, seconds: float) -> None:
        """Record the time that a batch took, s."""
        walks = sum(trial.duration for trial in batch) / min(threads, len(batch))
        self._speeds[batch[0].engine] = walks / max(seconds, 1e-9)


class Here:
    """Executor of this machine: one batch after the other, each on all cores."""

    words = ""
    _pace = Pace()  # of this process

    def cut(self, batches: Sequence[list[Trial]]) -> Iterator[list[Trial]]:
        """Yield the same batches in pieces of a few seconds of work."""
        for batch in batches:
            yield from self._pace.pieces(batch, cores())

    def walk(self, batches: Iterable[Sequence[Trial]]) -> Iterator[tuple[int, list[xr.Dataset]]]:
        """Walk one batch after the other."""
        for index, batch in enumerate(batches):
            begun = time.monotonic()
            records = walked(batch)
            self._pace.took(batch, cores(), time.monotonic() - begun)
            yield index, records


_CURRENT: ContextVar[Executor | None] = ContextVar("executor", default=None)


def current() -> Executor:
    """The executor in use: that of the innermost :func:`using` around, else this machine."""
    return _CURRENT.get() or Here()


@contextmanager
def using(executor: Executor) -> Iterator[None]:
    """Use an executor for all trials within this block, studies and tasks included, in this thread and in tasks of
    asyncio made in the block, but not in threads started in it."""
    token = _CURRENT.set(executor)
    try:
        yield
    finally:
        _CURRENT.reset(token)
