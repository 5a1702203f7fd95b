"""A robot from above, to scale, as a small drawing."""

from __future__ import annotations

from chilopod import units
from chilopod.gait import Gait
from chilopod.kinematics import foot_places
from chilopod.notebook import COLORS, INK, disc, label, svg
from chilopod.robot.parts import Body, Legs, Springs

_WIDTH, _MARGIN = 640.0, 24.0  # px
_MOST = 40  # modules that are drawn
_TOLD = 12  # modules up to which every spring has its number
_SLIMNESS = 0.3  # width of a module over its length, where its feet leave room
_OWN = 0.46  # half of what a module has of its length; between two is a joint
_UNIT = "N*mm/deg"


def schematic(body: Body, springs: Springs, legs: Legs, gait: Gait, name: str) -> str:
    """SVG of modules, joints with their springs, and feet at time 0, filled where they stand. The robot walks to the
    right. Only the front modules of a very long robot are drawn."""
    count = min(body.modules, _MOST)
    length = body.length / body.modules
    phases = gait.leg_phases(body.modules)[:count]
    feet = foot_places(legs.forward_offset, legs.half_width, gait.stroke(phases))
    stands = gait.stands(phases)
    # Feet may reach ahead of the front module or behind the rear one.
    beyond = max(0.0, abs(legs.forward_offset) + 0.5 * gait.stride - 0.5 * length)
    scale = (_WIDTH - 2.0 * _MARGIN) / (count * length + 2.0 * beyond)
    hip_ahead = min(max(legs.forward_offset, -_OWN * length), _OWN * length)
    width = min(_SLIMNESS * length, 1.6 * legs.half_width) or _SLIMNESS * length
    half_height = scale * max(legs.half_width, 0.5 * width) + _MARGIN
    front, middle = _WIDTH - _MARGIN - scale * beyond, half_height
    parts = []
    for module in range(count):
        centre = front - scale * (module + 0.5) * length
        for side, sign in enumerate((-1.0, 1.0)):
            ahead, left = feet[module, side]
            foot = centre + scale * ahead, middle - scale * left
            hip = centre + scale * hip_ahead, middle + sign * 0.5 * scale * width
            ends = f'x1="{hip[0]:.1f}" y1="{hip[1]:.1f}" x2="{foot[0]:.1f}" y2="{foot[1]:.1f}"'
            parts.append(f'<line {ends} stroke="{INK}"/>')
            parts.append(disc(*foot, 4.0, COLORS[1], 1.0 if stands[module, side] else 0.2))
        parts.append(
            f'<rect x="{centre - _OWN * scale * length:.1f}" y="{middle - 0.5 * scale * width:.1f}" '
            f'width="{2.0 * _OWN * scale * length:.1f}" height="{scale * width:.1f}" rx="3" '
            f'fill="{COLORS[0]}" fill-opacity="{0.6 if module == 0 else 0.3}" stroke="{COLORS[0]}"/>'
        )
    for joint in range(count - 1):
        at = front - scale * (joint + 1) * length
        parts.append(disc(at, middle, 4.0, INK))
        if body.modules <= _TOLD:
            parts.append(label(at, 12.0, f"{units.from_si(springs.stiffness[joint], _UNIT):.4g}"))
    alt = f"{name} from above: {body.modules} modules in a row"
    if count < body.modules:
        alt += f", of which the front {count} are drawn"
    return svg(_WIDTH, 2.0 * half_height, "".join(parts), alt)
