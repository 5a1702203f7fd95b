"""The steps that led to the spring law, each a law of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from chilopod.engine import Observation
from chilopod.frozen import Array
from chilopod.steering import ARRIVAL_RADIUS, SpringLaw

_ALL_THE_WAY = 1e9  # m: to the target, however far


@dataclass(frozen=True)
class InverseLaw(SpringLaw):
    """The paper's k1-hat of the circle to the target, set anew in every gait cycle. The spring stays as it is while
    the target is not seen."""

    def spring(self, seen: Observation) -> Array:
        """Stiffness of the first spring for an observation, N*m/rad, shape (robots,)."""
        curvature = 2.0 * np.sin(np.abs(seen.bearing)) / np.maximum(seen.distance, ARRIVAL_RADIUS)
        steady = np.clip(np.interp(curvature, self.curvatures, self.springs), self.softest, self.stiffest)
        return np.where(np.isnan(curvature), seen.stiffness[:, 0], steady)


@dataclass(frozen=True)
class EarlierLaw(SpringLaw):
    """Law without straightening for a target within its tightest circle. Without ``searches`` the spring stays as it is
    while the target is not seen."""

    searches: bool = True

    def spring(self, seen: Observation) -> Array:
        """Stiffness of the first spring for an observation, N*m/rad, shape (robots,)."""
        # A circle that leads round no target.
        towards = SpringLaw.spring(replace(self, tightest=ARRIVAL_RADIUS), seen)
        lost = super().spring(seen) if self.searches else seen.stiffness[:, 0]
        return np.where(np.isnan(seen.bearing), lost, towards)


def steps(law: SpringLaw) -> Mapping[str, SpringLaw]:
    """Laws from the first step to the given one, by the name of the part that each adds."""
    circle = {each.name: getattr(law, each.name) for each in fields(SpringLaw)} | {"ahead": _ALL_THE_WAY}
    return {
        "the spring of the circle to the target, once a cycle": InverseLaw(**circle),
        "its bend against the bend there is": EarlierLaw(**circle, searches=False),
        "looking for what is lost": EarlierLaw(**circle),
        "straightening for what lies within the tightest circle": replace(law, ahead=_ALL_THE_WAY),
        "a place ahead in place of the target": law,
    }
