"""Steering: courses of targets, radius and spring of the circle to a target, leg-yaw controller, and measures of
success."""

from chilopod.steering.actuated import ActuatedAxis
from chilopod.steering.course import COURSES, Course, Goal, course_named, random_course
from chilopod.steering.criteria import Criteria, Outcome, arrivals, earliest_arrival, evaluate
from chilopod.steering.leg_yaw import LegYawController
from chilopod.steering.measures import add_measures
from chilopod.steering.radius_law import RadiusLaw
from chilopod.steering.referee import CourseReferee, Judged, Verdict, decisions
from chilopod.steering.shortest import shortest_path
from chilopod.steering.spring_law import SpringLaw
from chilopod.steering.strategies import (
    LEG_YAW,
    ON_COURSES,
    ON_THE_WAY,
    STRATEGIES,
    VARIABLE,
    Prepared,
    Strategy,
    strategy_named,
)
from chilopod.steering.target import ARRIVAL_RADIUS, Target

__all__ = [
    "ARRIVAL_RADIUS",
    "COURSES",
    "LEG_YAW",
    "ON_COURSES",
    "ON_THE_WAY",
    "STRATEGIES",
    "VARIABLE",
    "ActuatedAxis",
    "Course",
    "CourseReferee",
    "Criteria",
    "Goal",
    "Judged",
    "LegYawController",
    "Outcome",
    "Prepared",
    "RadiusLaw",
    "SpringLaw",
    "Strategy",
    "Target",
    "Verdict",
    "add_measures",
    "arrivals",
    "course_named",
    "decisions",
    "earliest_arrival",
    "evaluate",
    "random_course",
    "shortest_path",
    "strategy_named",
]
