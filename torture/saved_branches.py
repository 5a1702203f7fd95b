"""Branches that were saved and then damaged: ``branch --resume`` refuses, or goes on as if nothing had happened."""

from __future__ import annotations

from random import Random

import xarray as xr

from damages import edited, on_bytes, replaced
from in_process import Place, called, snapshot
from outcomes import FoundFault, Kind, Outcome, changed, judged
from studies import BRANCH, content, put, whole

_FILE = "branch.nc"
_RESUME = (*BRANCH, "--points", "1", "--resume", "kept")


class SavedBranches:
    """The netCDF file of a branch; sometimes what lies beside it."""

    name = "branches"
    per_minute = 400

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One damage."""
        begun = whole(place, *BRANCH, "--points", "3", "--out", "kept")
        folder = place.here / "kept"
        put(begun.kept, folder)
        path, how = folder / _FILE, chance.randrange(12)
        if how < 8:
            path.write_bytes(on_bytes(begun.kept[_FILE], chance))
        elif how == 8:
            beside = chance.choice([name for name in begun.kept if name != _FILE])
            (folder / beside).write_bytes(on_bytes(begun.kept[beside], chance))
        elif how == 9:
            other = whole(place, *BRANCH, "--set", "body.mass=8 kg", "--points", "1", "--out", "kept")
            path.write_bytes(chance.choice((other.kept[_FILE], begun.kept["branch.csv"])))
        elif how == 10:
            edited(path, chance, "h5netcdf", _attributes)
        else:
            replaced(path, chance, place)
        place.tried.write_text(f"chilopod {' '.join(_RESUME)} with {_FILE} damaged in way {how}")
        before = snapshot(place.root)
        ending = called(_RESUME, place)
        after = snapshot(place.root)
        kind = judged(ending, before, after, named=[_FILE, "kept"], interrupted=place.interrupted.exists())
        if kind is Kind.ENDED:
            right = whole(place, *_RESUME, begun=begun)
            new = [name for name in changed(before, after) if not name.endswith(tuple(right.kept))]
            if ending.out != right.ending.out or new:
                raise FoundFault(Kind.WRONG, f"goes on otherwise {' '.join(new)}")
            for name, each in content(folder).items():
                if each != right.kept.get(name):
                    raise FoundFault(Kind.WRONG, f"{name} is another")
        return Outcome(kind, ending.err.strip()[-200:])


def _attributes(data: xr.Dataset) -> dict[str, object]:
    about = data.attrs
    return {
        "robot_toml": str(about["robot_toml"]).replace("41 ", "42 ", 1),
        "ending": "nowhere",
        "scale": float(about["scale"]) * 2.0,
        "step": float("nan"),
        "coefficient": 1.0,
        "criticality": "subcritical",
        "direction_confirms": "no",
        "highest_si": float(about["highest_si"]) * 1.01,
        "side": -1,
        "varied": "springs.stiffness[1]",
        "robot": "another",
    }
