"""Robots whose constants are known: what their rounded numbers allow must hold them."""

from __future__ import annotations

from random import Random

import numpy as np

from in_process import Place
from outcomes import FoundFault, Kind, Outcome


class KnownConstants:
    """A planar robot of a third to three times the size, identified from its rounded critical spring and mode."""

    name = "known-constants"
    per_minute = 20

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One robot."""
        from chilopod.paper.printed import critical_mode_data
        from chilopod.robot import load_robot
        from chilopod.tasks.identify import self_test

        seed = chance.randrange(2**31)
        place.tried.write_text(f"self_test of seed {seed}")
        found = self_test(load_robot("aoi2022-planar"), critical_mode_data(), 1, seed)
        (low, high), true = found.ranges[0].T, found.true[0]
        if not ((low <= true) & (true <= high)).all():
            raise FoundFault(Kind.WRONG, f"of {true} the numbers allow {low} to {high}")
        if np.isnan(found.intervals).any():
            raise FoundFault(Kind.WRONG, f"no interval of {true}: {found.intervals[0]}")
        return Outcome(Kind.ENDED)
