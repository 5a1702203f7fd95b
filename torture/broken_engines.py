"""Engines of one's own that do not give what they are asked for: one line that names them, and nothing is kept."""

from __future__ import annotations

import sys
from random import Random

from in_process import Place, called, snapshot
from outcomes import FoundFault, Kind, Outcome, judged

_MODULE = """
import sys
from dataclasses import dataclass
import numpy as np
import xarray as xr
from chilopod import planar
from chilopod.engine import Command, Event, Status

PART = {part!r}


class Fatal(BaseException):
    pass


def one_of(values):
    return values[int(PART * len(values))]


class Walk:
    def __init__(self, walk):
        self.walk = walk

    def __getattr__(self, name):
        return getattr(self.walk, name)

{walk}

class Engine:
    traits = planar.traits
    common, initial_states = staticmethod(planar.common), staticmethod(planar.initial_states)

    def resume(self, saved):
        return Walk(planar.resume(saved))

    def start(self, robots, **given):
        return Walk(planar.start(robots, **given))

{engine}

engine = Engine()


@dataclass(frozen=True)
class Steers:
    def events(self, gait):
        return [Event("now", 0.3, 0.1)]

    def act(self, event, seen):
        return Command(leg_yaw=np.zeros((len(seen.bearing), 2)))
"""
_RECORD = "    def to_dataset(self):\n        data = self.walk.to_dataset()\n"
_MOTION = "('position', 'velocity', 'heading', 'heading_rate', 'joint_angle', 'joint_rate', 'leg_yaw')"
_VARIABLE = f"        name = one_of({_MOTION})\n"
_VALUES = f"{_VARIABLE}        values = data[name].values\n"
RECORDS = {
    "three samples": "        return data.isel(time=slice(3))\n",
    "half of the samples": "        return data.isel(time=slice(None, None, 2))\n",
    "times that stand still": "        data['time'] = data.time.where(data.time != data.time[3], data.time[2])\n"
    "        return data\n",
    "no samples": "        return data.isel(time=slice(0))\n",
    "another time axis": "        return data.assign_coords(time=data.time * one_of((1e3, 0.5, -1.0, np.nan)))\n",
    "later times": "        return data.assign_coords(time=data.time + 1.0)\n",
    "nothing but NaN": f"{_VALUES}        values[:] = np.nan\n        return data\n",
    "one NaN": f"{_VALUES}        values[len(values) // 2] = np.nan\n        return data\n",
    "one infinity": f"{_VALUES}        values[-1] = np.inf\n        return data\n",
    "a missing variable": f"{_VARIABLE}        return data.drop_vars(name)\n",
    "no springs": "        return data.drop_vars('stiffness')\n",
    "no status": "        return data.drop_vars('status')\n",
    "no target": "        return data.drop_vars('target')\n",
    "no commands": "        return data.isel(event=slice(0))\n",
    "a command more or less": "        return data.isel(event=slice(1, None))\n",
    "robots more": "        return xr.concat([data, data], 'robot', data_vars='minimal')\n",
    "robots less": "        return data.isel(robot=slice(1, None))\n",
    "robots in another order": "        return data.isel(robot=slice(None, None, -1))\n",
    "joints less": "        return data.isel(joint=slice(1, None))\n",
    "axes in another order": f"{_VARIABLE}        data[name] = data[name].transpose('robot', ...)\n"
    "        return data\n",
    "another type": f"{_VARIABLE}        return data.assign({{name: data[name].astype(one_of(('f4', 'O', 'U9')))}})\n",
    "another status": "        data['status'][:] = one_of(('fallen', 'fine', '', None))\n        return data\n",
    "mirrored": "        return data.assign(joint_angle=-data.joint_angle, joint_rate=-data.joint_rate)\n",
    "turned": "        return data.assign(heading=data.heading + 0.1)\n",
    "another target": "        return data.assign(target=-data.target)\n",
    "springs of another robot": "        return data.assign(stiffness=2 * data.stiffness)\n",
    "elsewhere": "        return data.assign(position=data.position + one_of((1e-5, 0.3, 1e3)))\n",
    "the last sample missing": "        return data.isel(time=slice(None, -1))\n",
    "a sample more": "        more = data.isel(time=[-1]).assign_coords(time=[data.time.values[-1] + 0.01])\n"
    "        return xr.concat([data, more], 'time', data_vars='minimal')\n",
    "times a little off": "        times = data.time.values + one_of((1e-6, 1e-3, 9e-3))\n"
    "        return data.assign_coords(time=('time', times, data.time.attrs))\n",
    "legs turned at the start": "        data.leg_yaw[:, :, one_of((0, 1))] += 0.1\n        return data\n",
    "another duration": "        return data.assign_attrs(duration=one_of((1.0, 2.01, '2 s', np.nan, None)))\n",
    "another robot's file": "        text = data.attrs['robot']\n"
    "        return data.assign_attrs(robot=one_of(('', 'aoi2022', None, text + 'x', text[:-1])))\n",
    "another engine's name": "        return data.assign_attrs(engine=one_of(('twin', '', None)))\n",
    "another unit": f"{_VARIABLE}        data[name].attrs = one_of(({{'units': 'deg'}}, {{}}))\n        return data\n",
    "time in another unit": "        data['time'].attrs['units'] = 'ms'\n        return data\n",
    "another variable": "        return data.assign({one_of(('extra', 'foot_force', 'pose')): data.position})\n",
    "another coordinate": "        return data.assign_coords(day=1.0)\n",
    "coordinates of others": "        name = one_of(('robot', 'joint', 'side', 'axis'))\n"
    "        return data.assign_coords({name: data[name].values[::-1]})\n",
    "a huge number": f"{_VALUES}        values[len(values) // 2] = one_of((1e300, -1e101))\n        return data\n",
    "huge springs": "        return data.assign(stiffness=data.stiffness * 1e300)\n",
    "a command of another size": "        return data.assign(command=data.command.astype('f4'))\n",
    "nothing": "        return one_of((None, 3, {}, 'data', np.zeros(3)))\n",
    "an empty dataset": "        return xr.Dataset()\n",
    "an exception of the record": "        raise one_of((KeyError, SystemExit, Fatal, StopIteration))('x')\n",
}
WALKS = {
    "advance does nothing": "    def advance(self, until):\n        pass\n",
    "advance stops half way": "    def advance(self, until):\n        self.walk.advance(until / 2)\n",
    "advance goes further": "    def advance(self, until):\n        self.walk.advance(until + 0.1)\n",
    "advance raises": "    def advance(self, until):\n"
    "        raise one_of((ZeroDivisionError, SystemExit, Fatal, GeneratorExit))('x')\n",
    "time is none": "    time = None\n",
    "status raises": "    @property\n    def status(self):\n        raise RuntimeError('x')\n",
    "status is another": "    status = property(lambda self: (Status.FALLEN,) * len(self.walk.status))\n",
    "observe raises": "    def observe(self):\n        raise one_of((ValueError, Fatal))('x')\n",
    "observes another shape": "    def observe(self):\n        from dataclasses import replace\n"
    "        name = one_of(('bearing', 'distance', 'joint_angles', 'leg_yaw', 'stiffness'))\n"
    "        return replace(self.walk.observe(), **{name: one_of((None, np.zeros((1, 9)), np.zeros(2, int)))})\n",
    "observes nothing": "    def observe(self):\n        return one_of((None, 3, {}))\n",
    "command raises": "    def command(self, command):\n        raise one_of((ValueError, Fatal))('x')\n",
    "command does nothing": "    def command(self, command):\n        pass\n",
}
ENGINES = {
    "start gives nothing": "    def start(self, robots, **given):\n        return one_of((None, 3, object()))\n",
    "start forgets a robot": "    def start(self, robots, **given):\n        most = max(1, len(robots) - 1)\n"
    "        rows = {name: given[name][:most] for name in ('initial', 'friction', 'target')}\n"
    "        return Walk(planar.start(robots[:most], **given | rows))\n",
    "start forgets where": "    def start(self, robots, **given):\n"
    "        return Walk(planar.start(robots, **given | {'initial': None}))\n",
    "start forgets the target": "    def start(self, robots, **given):\n"
    "        return Walk(planar.start(robots, **given | {'target': None}))\n",
    "start records otherwise": "    def start(self, robots, **given):\n        from chilopod.record import Recording\n"
    "        return Walk(planar.start(robots, **given | {'record': Recording(7.0)}))\n",
    "initial states raise": "    def initial_states(self, *given, **named):\n        raise ValueError\n",
    "common has no hash": "    def common(self, robot):\n        return []\n",
}
NONE = "nothing is wrong"
FAULTS = (NONE, *RECORDS, *WALKS, *ENGINES)
_STUDY = ("turn", "aoi2022-planar", "--target", "30 deg, 1.2 m", "--k1", "20 N*mm/deg")
_COMMAND = (*_STUDY, "--duration", "2 s", "--controller", "own_engines:Steers", "--engine", "own_engines:engine")


class BrokenEngines:
    """The planar engine with one fault, in a study that would keep its trials."""

    name = "broken-engines"
    per_minute = 120

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One fault."""
        fault, part = chance.choice(FAULTS), chance.random()
        place.tried.write_text(f"an engine: {fault}, {part:.3f}")
        walk = _RECORD + RECORDS[fault] if fault in RECORDS else WALKS.get(fault, "")
        text = _MODULE.format(part=part, walk=walk, engine=ENGINES.get(fault, ""))
        (place.here / "own_engines.py").write_text(text)
        before = snapshot(place.root)
        try:
            ending = called((*_COMMAND, "--seed", "1", "--repeats", "2", "--trials", "kept", "--json"), place)
        finally:
            sys.modules.pop("own_engines", None)
            sys.path_importer_cache.clear()
        after = {name: each for name, each in snapshot(place.root).items() if "__pycache__" not in name}
        after.pop("home/.cache", None)
        kind = judged(ending, before, after, named=["own_engines"])
        if kind is not Kind.REFUSED and fault == NONE:
            return Outcome(kind)
        if kind is not Kind.REFUSED or fault == NONE:
            raise FoundFault(Kind.WRONG, f"{fault}: {ending.err.strip()[-200:] or 'accepted'}")
        if "own_engines:engine" not in ending.err:
            raise FoundFault(Kind.FIELD, f"{fault}: {ending.err.strip()[-200:]}")
        return Outcome(kind, ending.err.strip()[-200:])
