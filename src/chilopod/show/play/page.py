"""HTML of the page, and the numbers that its scripts read."""

from __future__ import annotations

from typing import Any

import xarray as xr
from scipy.integrate import DOP853

from chilopod.analysis.parameters import stiffness
from chilopod.analysis.radius_law import radius_laws
from chilopod.errors import AnalysisError
from chilopod.planar import PlanarModel
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.show.scene.outline import SLIMNESS
from chilopod.show.style import SCENE as COLORS
from chilopod.show.templates import template
from chilopod.steering import ARRIVAL_RADIUS, LegYawController, RadiusLaw, SpringLaw
from chilopod.steering.course import Course
from chilopod.tasks.radius_law import that_holds

_SOFTEST, _STIFFEST = 0.05, 1.25  # of the stiffest spring of the file: range of the slider
_STAGES = 12
_SEARCH = 60.0  # s for the pitchfork, as at the command line


def play(robot: Robot, progress: Progress = silent) -> str:
    """HTML of a page with a walking robot of the planar model, a slider of its first spring, and the signed bend over
    the spring. It is one file, which loads nothing else and opens from disk.

    ``progress`` is called with the part done (0 to 1) and a few words while the branch of curved walks is computed.
    Raises an AnalysisError if the straight walk has no pitchfork in the first spring, or the branch gives no radius
    law.
    """
    data = {**motion(robot), **_pictured(robot, *theory(robot, progress)), **_look(robot)}
    return template("chilopod.show.play", "page.html.j2").render(robot=robot.name, data=data)


def motion(robot: Robot) -> dict[str, Any]:
    """Numbers of the motion: the robot, its contact pattern, the paper's leg yaw and the integrator, SI and radians."""
    model, gait, schedule = PlanarModel(robot), robot.gait, PlanarModel(robot).schedule
    length, mass, inertia, speed = model.scalars[0].tolist()
    yaw = LegYawController()
    events = yaw.events(gait)
    sides = [{"phase": event.phase, "side": side} for side, event in enumerate(events)]
    return {
        "modules": model.modules,
        "length": length,
        "mass": mass,
        "inertia": inertia,
        "speed": speed,
        "springs": model.stiffness.tolist(),
        "damping": model.damping.tolist(),
        "friction": robot.ground.friction,
        "forwardOffset": robot.legs.forward_offset,
        "halfWidth": robot.legs.half_width,
        "gait": {
            "period": gait.period,
            "duty": gait.duty,
            "stride": gait.stride,
            "times": schedule.times.tolist(),
            "contact": schedule.contact.astype(int).tolist(),
            "stroke": schedule.stroke.tolist(),
            "phases": gait.leg_phases(model.modules).tolist(),
        },
        "legYaw": {"step": yaw.step, "limit": yaw.limit, "window": events[0].window, "events": sides},
        "view": {"angle": 0.5 * Course.view, "range": Course.range},
        "arrivalRadius": ARRIVAL_RADIUS,
        "tableau": {
            "A": [DOP853.A[stage, :stage].tolist() for stage in range(_STAGES)],
            "B": DOP853.B.tolist(),
            "C": DOP853.C[:_STAGES].tolist(),
            "E3": DOP853.E3.tolist(),
            "E5": DOP853.E5.tolist(),
        },
    }


def theory(robot: Robot, progress: Progress = silent) -> tuple[xr.Dataset, RadiusLaw]:
    """Left turns of a robot, and the radius law of its axis as far as it gets there from straight; errors as of
    :func:`play`."""
    try:
        laws = radius_laws(robot, progress, _SEARCH)
    except AnalysisError as error:
        if error.field == "branch":
            error.field, error.value, error.allowed = "robot", robot.name, "one whose turns tighten as k1 falls"
        raise
    return laws.walks, that_holds(laws.axis, robot)


def _pictured(robot: Robot, walks: xr.Dataset, law: RadiusLaw) -> dict[str, Any]:
    """Branch as bends over the first spring, and the law that steers by this spring."""
    steers = SpringLaw.of(robot, law)
    return {
        "pitchfork": float(law.pitchfork),
        "branch": {
            "springs": walks.parameter_si.values.tolist(),
            "bends": (steers.arm / walks.axis_radius.values).tolist(),
            "stable": [bool(each) for each in walks.stable.values],
        },
        "law": {
            "softest": steers.softest,
            "stiffest": steers.stiffest,
            "curvatures": steers.curvatures.tolist(),
            "springs": steers.springs.tolist(),
            "tightest": steers.tightest,
            "arm": steers.arm,
            "ahead": steers.ahead,
            "band": steers.band,
            "straight": steers.straight,
            "mostBent": steers.most_bent,
        },
    }


def _look(robot: Robot) -> dict[str, Any]:
    """Names, colours, and the range of the slider."""
    stiffest = max(robot.springs.stiffness)
    return {
        "name": robot.name,
        "colors": COLORS,
        "width": SLIMNESS * robot.module_length,
        "unit": stiffness(1.0),
        "range": [_SOFTEST * stiffest, _STIFFEST * stiffest],
    }
