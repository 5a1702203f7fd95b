"""Contract between engines and controllers: engines start walks, which advance step by step, and controllers steer
them.

``contract`` defines the contract, ``actuators`` carries out commands within the robot's limits, ``targets`` keeps the
positions of targets, ``loop`` lets a controller steer a walk, ``named`` finds engines and controllers by name,
``one_thread`` keeps a walk to one thread at a time, and ``check`` tests an engine against the contract.
"""

from chilopod.engine.actuators import Actuators, Ramps
from chilopod.engine.check import check_engine
from chilopod.engine.contract import Command, Controller, Engine, Event, HasFootCreep, Observation, Status, Traits, Walk
from chilopod.engine.loop import Referee, Spent, event_times, steer, watched
from chilopod.engine.named import ENGINES, controller_named, engine_named
from chilopod.engine.one_thread import one_thread
from chilopod.engine.targets import Targets
from chilopod.frozen import Array

__all__ = [
    "ENGINES",
    "Actuators",
    "Array",
    "Command",
    "Controller",
    "Engine",
    "Event",
    "HasFootCreep",
    "Observation",
    "Ramps",
    "Referee",
    "Spent",
    "Status",
    "Targets",
    "Traits",
    "Walk",
    "check_engine",
    "controller_named",
    "engine_named",
    "event_times",
    "one_thread",
    "steer",
    "watched",
]
