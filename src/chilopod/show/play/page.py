"""HTML of the page, and the numbers that its scripts read."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any, Final, NamedTuple

import xarray as xr
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from scipy.integrate import DOP853

from chilopod.analysis.parameters import stiffness
from chilopod.analysis.radius_law import radius_laws
from chilopod.planar import PlanarModel
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.show.scene.outline import SLIMNESS
from chilopod.show.style import SCENE as COLORS
from chilopod.steering import ARRIVAL_RADIUS, LegYawController, RadiusLaw, SpringLaw
from chilopod.steering.course import Course
from chilopod.tasks.radius_law import that_holds

_SCRIPTS: Final = ("model.js", "page.js")
_SOFTEST, _STIFFEST = 0.05, 1.25  # of the stiffest spring of the file: range of the slider
_STAGES = 12


def play(robot: Robot, progress: Progress = silent) -> str:
    """Page with a walking robot, a slider of its first spring, and the signed bend over the spring.

    The page is one HTML file. It loads nothing else and opens from disk.

    Parameters
    ----------
    robot
        Robot of the planar model.
    progress
        Called with the part done (0 to 1) and a few words, while the branch of curved walks is computed.

    Returns
    -------
    str
        The HTML.

    Raises
    ------
    AnalysisError
        If the straight walk has no pitchfork in the first spring, or the branch gives no radius law.
    """
    folder = files("chilopod.show.play")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(folder.joinpath("page.html.j2").read_text(encoding="utf-8"))
    scripts = [folder.joinpath(name).read_text(encoding="utf-8") for name in _SCRIPTS]
    data = {**motion(robot), **_pictured(robot, theory(robot, progress)), **_look(robot)}
    return template.render(
        robot=robot.name,
        css=Markup(folder.joinpath("page.css").read_text(encoding="utf-8")),
        scripts=[Markup(script) for script in scripts],
        data=Markup(json.dumps(data, allow_nan=False).replace("<", "\\u003c")),
    )


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


class Theory(NamedTuple):
    """Curved walks of a robot, and its radius law."""

    walks: xr.Dataset  # branch of left turns, see :func:`chilopod.analysis.curved_walks`
    law: RadiusLaw  # radius of the body axis over the first spring, as far as a robot reaches it from straight


def theory(robot: Robot, progress: Progress = silent) -> Theory:
    """Branch and radius law of a robot; errors as of :func:`play`."""
    laws = radius_laws(robot, progress)
    return Theory(laws.walks, that_holds(laws.axis, robot))


def _pictured(robot: Robot, found: Theory) -> dict[str, Any]:
    """Branch as bends over the first spring, and the law that steers by this spring."""
    steers, walks = SpringLaw.of(robot, found.law), found.walks
    return {
        "pitchfork": float(found.law.pitchfork),
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
