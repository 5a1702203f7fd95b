"""Sentences about a walk, which change with it."""

from __future__ import annotations

import math

import numpy as np

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.engine import Status
from chilopod.live.state import Seen, Settings
from chilopod.live.theory import Growth, Theory

_STRAIGHT = 0.15  # rad of bend in all that nudges alone may make
_SETTLED = 0.1  # of the branch's radius
_SLOW = 0.03  # of its bend a second, by which a settled walk may still move


def spring_text(stiffness: float) -> str:
    """A spring as the paper writes it."""
    return f"{units.from_si(stiffness, PAPER_UNIT):.3g} N·mm/deg"


def radius_of(seen: Seen) -> float:
    """Radius of the arc that the body makes, m: the paper's measure, infinite if straight."""
    return float(seen.robot.axis_radius(seen.mean_angles))


def sentences(seen: Seen, settings: Settings, theory: Theory, growth: Growth | None) -> list[str]:
    """Sentences on a walk now, the most important first; theory and growth are those of this robot."""
    if seen.status is not Status.WALKED:
        return [f"It has stopped: {seen.status.sentence}. Press R to begin anew."]
    said = []
    if settings.paused:
        said.append("Paused: the space bar goes on.")
    if seen.target is not None:
        away = math.dist(seen.target, seen.pose[:2])
        if seen.steering:
            said.append(f"On its way to the target, {away:.2f} m off, with the strategy {seen.steering}.")
            said += _held(seen, settings)
        else:
            said.append(f"The target is {away:.2f} m off, and nothing but you steers.")
    if seen.pulled.any():
        pulled = [str(joint + 1) for joint in np.flatnonzero(seen.pulled)]
        who = f"Joint {pulled[0]} is" if len(pulled) == 1 else f"Joints {', '.join(pulled)} are"
        return [*said, f"{who} pulled aside, and it walks {_arc(seen)} as long as that lasts."]
    if seen.steering:
        # Who steers makes the curve, not the spring: what the straight or the curved walk would do is not to be seen.
        return [*said, f"Steered, it walks {_arc(seen)}."]
    set_to = np.allclose(seen.stiffness, settings.robot.springs.stiffness)  # springs may be on their way
    said.append(_bend(seen, theory, growth if growth and set_to and growth.robot == settings.robot else None))
    return said


def _held(seen: Seen, settings: Settings) -> list[str]:
    """The first spring as the strategy has it, where the slider shows another one."""
    here, set_to = (spring_text(float(each)) for each in (seen.stiffness[0], settings.robot.springs.stiffness[0]))
    if here == set_to:
        return []
    return [f"The strategy has the first spring at {here} now; yours, {set_to}, is back when the target is let go."]


def _bend(seen: Seen, theory: Theory, growth: Growth | None) -> str:
    k1 = float(seen.stiffness[0])
    radius, side, arc = radius_of(seen), _side(seen), _arc(seen, growth)
    if theory.pitchfork is None:
        return _without_pitchfork(seen, theory, growth)
    fork, settled = f"the pitchfork at {spring_text(theory.pitchfork)}", theory.settled(k1)
    if k1 >= theory.pitchfork:
        stiff = f"its first spring, {spring_text(k1)}, is stiffer than {fork}"
        if growth and growth.rate > 0.0:
            return f"It walks {arc}. Though {stiff}, the straight walk is unstable: {_grows(growth)}."
        if not theory.verdict(k1) and not (growth and growth.rate < 0.0):
            return f"It walks {arc}: {stiff}."
        if seen.bend > _STRAIGHT:
            now = "straightens" if seen.turning < 0.0 else "will straighten"
            return f"The {f'curve of {radius:.2f} m' if seen.curves else 'bend'} {now}: {stiff}."
        fades = f", and what disturbs it fades by {_percent(growth)} a second" if growth and growth.rate < 0.0 else ""
        return f"Straight and stable: {stiff}{fades}."
    soft = f"Past the pitchfork: its first spring, {spring_text(k1)}, is softer than {spring_text(theory.pitchfork)}"
    if settled is None:
        beyond = theory.remark or "no settled curve is known with this spring"
        return f"{soft}, and it walks {arc} ({beyond})."
    if seen.bend <= _STRAIGHT or seen.undulates:
        speed = f" by {_percent(growth)} a second" if growth and growth.rate > 0.0 else ""
        grows = f"the smallest bend grows{speed}, to {settled:.2f} m in the end"
        return f"{soft}: the straight walk is unstable, and {grows}."
    if not seen.curves:
        return f"{soft}, and it walks {arc}."
    if abs(radius - settled) < _SETTLED * settled and abs(seen.turning) < _SLOW * seen.bend:
        return f"Settled on {arc}; the branch of curved walks has {settled:.2f} m. {soft}."
    return f"{soft}. The curve, {radius:.2f} m to the {side}, {_moving(radius, settled, seen)}."


def _without_pitchfork(seen: Seen, theory: Theory, growth: Growth | None) -> str:
    """Sentences on a robot whose pitchfork is not known yet, or that has none."""
    walks = f"It walks {_arc(seen, growth)}."
    if growth:
        stable = growth.rate <= 0.0
        now = f"what disturbs it fades by {_percent(growth)} a second" if stable else _grows(growth)
        walks += f" The straight walk is {'stable' if stable else 'unstable'}: {now}."
    if theory.computing:
        return f"{walks} Where it gives way is not known yet: {theory.remark or 'computing the pitchfork'}."
    return f"{walks} It has no pitchfork in the first spring to show: {theory.remark or 'nothing was computed'}."


def _grows(growth: Growth) -> str:
    """Growth of an unstable straight walk, in words."""
    return f"{'a sway from side to side' if growth.sways else 'the smallest bend'} grows by {_percent(growth)} a second"


def _moving(radius: float, settled: float, seen: Seen) -> str:
    """Present radius beside the branch's, and its change, in words; a bend may overshoot and sway."""
    moves, towards = "tightens" if seen.turning > 0.0 else "widens", "tightens" if radius > settled else "widens"
    if seen.turning and moves == towards:
        return f"{moves} towards the branch's {settled:.2f} m"
    than = f"is {'wider' if radius > settled else 'tighter'} than the branch's {settled:.2f} m"
    return f"{than}, and {moves} just now" if seen.turning else than


def _side(seen: Seen) -> str:
    return "left" if seen.mean_angles.sum() < 0.0 else "right"


def _arc(seen: Seen, growth: Growth | None = None) -> str:
    """Way of a walk in words; a bend that goes from side to side, or is bound to, or not along the path is no curve."""
    if seen.bend <= _STRAIGHT:
        return "straight on"
    if seen.undulates:
        return "on, swaying from side to side"
    if not seen.curves or (growth and growth.rate > 0.0 and growth.sways):
        return f"on, bent {f'to the {_side(seen)}' if seen.one_way else 'both ways'} just now"
    return f"a curve of {radius_of(seen):.2f} m to the {_side(seen)}"


def _percent(growth: Growth) -> str:
    """Change of a disturbance in a second, in words."""
    return f"{100.0 * abs(math.expm1(growth.rate)):.0f} %"
