"""The steps that led to the spring law, each a law of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from chilopod.engine import Observation
from chilopod.steering import ARRIVAL_RADIUS, SpringLaw

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InverseLaw(SpringLaw):
    """The paper's k1-hat of the circle to the target, set anew in every gait cycle; a target that is not seen leaves
    the spring as it is."""

    def spring(self, seen: Observation) -> Array:
        """Stiffness of the first spring for what is seen, N*m/rad, shape (robots,)."""
        curvature = 2.0 * np.sin(np.abs(seen.bearing)) / np.maximum(seen.distance, ARRIVAL_RADIUS)
        steady = np.clip(np.interp(curvature, self.curvatures, self.springs), self.softest, self.stiffest)
        return np.where(np.isnan(curvature), seen.stiffness[:, 0], steady)


@dataclass(frozen=True)
class WithoutSearch(SpringLaw):
    """As the law, but a target that is not seen leaves the spring as it is."""

    def spring(self, seen: Observation) -> Array:
        """Stiffness of the first spring for what is seen, N*m/rad, shape (robots,)."""
        return np.where(np.isnan(seen.bearing), seen.stiffness[:, 0], super().spring(seen))


def steps(law: SpringLaw) -> Mapping[str, SpringLaw]:
    """Laws from the first step to the last, which is the one that is given, by what each has beyond the one before."""
    own = {each.name: getattr(law, each.name) for each in fields(SpringLaw)}
    # A circle that leads round no target: the law never straightens for one that lies within it.
    curvatures = np.append(law.curvatures, max(1.0 / ARRIVAL_RADIUS, 1.01 * law.curvatures[-1]))
    springs = np.append(law.springs, law.springs[-1])
    return {
        "the spring of the circle, once a cycle": InverseLaw(**own),
        "its bend against the bend there is": WithoutSearch(**{**own, "curvatures": curvatures, "springs": springs}),
        "looking for what is lost": replace(law, curvatures=curvatures, springs=springs),
        "straightening for what lies within its circle": law,
    }
