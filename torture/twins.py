"""Two twins whose constants are known, asked back for from their own walks: do the 90 % intervals hold them?

``python torture/twins.py FOLDER`` draws the constants from the valley of the paper's robot, by weight. The data of each
are its own walks, each number with a normal error of 5 %. The first searches begin with the fits that chilopod has
(without the two). The second ones begin with all evaluations of the first. Evaluations are kept in the folder, so a run
that was stopped goes on where it was. It takes some four hours of one processor.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from chilopod import load_robot, units
from chilopod.analysis.square_root import square_root_fit
from chilopod.frozen import Array
from chilopod.tasks.identify import twin, twin_series
from chilopod.tasks.identify.data import FITTED, TEMPLATES, BaseSeries, load_data
from chilopod.tasks.identify.valley import Samples

SEED, ERROR = 20261128, 0.05
FIRST, SECOND = (420, 160), (32, 200)  # evaluations (of the second searches, beside those of the first) and samples
ROBOT = load_robot("aoi2022")


def drawn() -> tuple[list[Array], list[Array], list[Array]]:
    """Constants of two twins, in parts of their ranges, other known sets, and normal errors of the four data."""
    fits, rng = twin.known(), np.random.default_rng(SEED)
    weights = np.array([fit.weight for fit in fits])
    chosen = rng.choice(len(fits), 2, replace=False, p=weights / weights.sum())
    inside = [i for i, fit in enumerate(fits) if ((fit.parts >= 0.0) & (fit.parts <= 1.0)).all()]
    errors = [rng.normal(size=4) for _ in chosen]
    return [fits[i].parts for i in chosen], [fits[i].parts for i in inside if i not in chosen], errors


def measured(parts: Array, errors: Array, folder: Path) -> tuple[BaseSeries, twin_series.Series]:
    """Data of a twin with these constants, and its walks without errors."""
    (folder / "paper.toml").write_text(TEMPLATES["twin"])
    paper: BaseSeries = load_data(folder / "paper.toml", BaseSeries)
    # All walks begin with the bends of the paper's data, so that evaluations serve both twins.
    joints, point = ROBOT.body.modules - 1, 1.0 / paper.onset[0]
    (spring, (radius, _)), *_ = paper.radii.items()
    law = joints * ROBOT.module_length / radius / np.sqrt(1.0 / spring - point), point
    data = paper.model_copy(update={"law": law, "shape": (1.0 / joints,) * joints})
    found = twin_series.base_series(FITTED.robot_with(ROBOT, FITTED.values_at(parts)), data)
    bends = dict(zip(data.springs, np.abs(found.bends).sum(axis=1).tolist(), strict=True))
    curved = [data.springs.index(k) for k in data.curved]
    onset = square_root_fit(1.0 / np.array(data.curved), np.abs(found.bends[curved, 0])).critical
    off = 1.0 + ERROR * errors
    radii = {k: joints * ROBOT.module_length / bends[k] for k in data.radii}
    speeds = {k: float(found.speeds[data.springs.index(k)]) for k in data.speeds}
    changed: dict[str, Any] = {
        "radii": {k: (r * e, ERROR * r) for (k, r), e in zip(radii.items(), off[:2].tolist(), strict=True)},
        "onset": (onset * off[2], ERROR * onset),
        "speeds": {k: (v * off[3], ERROR * v) for k, v in speeds.items()},
    }
    return data.model_copy(update=changed), found


def searched(folder: Path, which: int, stage: int, data: BaseSeries, starts: list[Array]) -> list[twin.Fit]:
    """Fits of a search, kept in the folder."""
    path = folder / f"twin-{which}-{stage}.json"
    if path.exists():
        return [twin.Fit(np.array(p), np.array(r), w) for p, r, w in json.loads(path.read_text())]
    counts = (FIRST, (len(starts) + SECOND[0], SECOND[1]))[stage]

    def shown(_: float, words: str) -> None:
        print(f"twin {which}, search {stage}: {words}", file=sys.stderr)

    fits, _ = twin.search(ROBOT, data, starts, counts, (1, 101)[stage] + which, folder / "walks", shown)
    path.write_text(json.dumps([[fit.parts.tolist(), fit.residuals.tolist(), fit.weight] for fit in fits]))
    return fits


def report(fits: list[twin.Fit], parts: Array, data: BaseSeries, found: twin_series.Series, folder: Path) -> None:
    """Print the intervals of the constants, and of measures of the walks that are no data."""
    kept = [fit for fit in fits if fit.weight]
    weights = np.array([fit.weight for fit in kept])
    samples = Samples(np.array([fit.parts for fit in kept]), weights / weights.sum())
    print(f"{samples.effective:.3g} effective samples of {len(kept)}")
    rows = [(path, part, samples.parts[:, i]) for i, (path, part) in enumerate(zip(FITTED.paths, parts, strict=True))]
    walks = [twin.walked(ROBOT, fit.parts, data, folder / "walks")[1] for fit in kept]
    for k in (0, 1, 4):
        bends = np.array([np.abs(each.bends[k]).sum() for each in walks])
        shown = units.format(data.springs[k], ROBOT.unit_of("springs.stiffness[0]"), digits=3)
        rows.append((f"bend at {shown}", float(np.abs(found.bends[k]).sum()), bends))
    rows.append(("speed at the stiffest spring", float(found.speeds[-1]), np.array([w.speeds[-1] for w in walks])))
    for name, true, values in rows:
        low, high = samples.interval(values)
        print(f"  {name:34s} {true:.4f}, 90 %: {low:.4f} to {high:.4f}{'' if low <= true <= high else '  MISSED'}")


def main() -> None:
    """Search for both, and report."""
    twin_series._HOPELESS = np.inf  # no walk is given up, as it may be good for the other twin
    folder = Path(sys.argv[1])
    (folder / "walks").mkdir(parents=True, exist_ok=True)
    truths, known, errors = drawn()
    data = [measured(parts, off, folder) for parts, off in zip(truths, errors, strict=True)]
    first = [searched(folder, i, 0, each, known) for i, (each, _) in enumerate(data)]
    starts = known + [fit.parts for fits in first for fit in fits[len(known) :]]
    for i, (each, found) in enumerate(data):
        print(f"twin {i}")
        report(searched(folder, i, 1, each, starts), truths[i], each, found, folder)


if __name__ == "__main__":
    main()
