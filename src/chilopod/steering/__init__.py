"""What to command: the radius a target asks for, the spring that gives it, the leg-yaw controller, how well it went."""

from chilopod.steering.criteria import Criteria, Outcome, arrivals, earliest_arrival, evaluate
from chilopod.steering.leg_yaw import LegYawController
from chilopod.steering.radius_law import RadiusLaw
from chilopod.steering.strategies import STRATEGIES, Strategy, steered, strategy_named
from chilopod.steering.target import ARRIVAL_RADIUS, Target

__all__ = [
    "ARRIVAL_RADIUS",
    "STRATEGIES",
    "Criteria",
    "LegYawController",
    "Outcome",
    "RadiusLaw",
    "Strategy",
    "Target",
    "arrivals",
    "earliest_arrival",
    "evaluate",
    "steered",
    "strategy_named",
]
