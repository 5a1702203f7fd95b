"""What to command: the radius a target asks for, the spring that gives it, the leg-yaw controller, how well it went."""

from chilopod.steering.criteria import Criteria, Outcome, earliest_arrival, evaluate
from chilopod.steering.leg_yaw import LegYawController
from chilopod.steering.radius_law import RadiusLaw
from chilopod.steering.strategies import STRATEGIES, Strategy, steered
from chilopod.steering.target import Target

__all__ = [
    "STRATEGIES",
    "Criteria",
    "LegYawController",
    "Outcome",
    "RadiusLaw",
    "Strategy",
    "Target",
    "earliest_arrival",
    "evaluate",
    "steered",
]
