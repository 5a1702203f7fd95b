"""Turning to a target: the sections of this chapter, and their rows beside the paper's robot."""

from __future__ import annotations

from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper import printed, statements
from chilopod.paper.movies import movies
from chilopod.paper.printed import CRITERION_NAMES
from chilopod.paper.section import Context, Movie, Section
from chilopod.paper.table import OfPlanar, Result, Row, agreement, unprinted
from chilopod.paper.turning.figures import panels
from chilopod.paper.turning.study import ROUGH, SCALES, Turning, counted, minima, softest_minima, turning
from chilopod.paper.turning.trials import by_leg_yaw, outcome_words, span
from chilopod.progress import Progress

CHAPTER = "Turning to a target"

# N*mm/deg: what `chilopod turn` finds for task A; the movie takes the best of the trials where there are any.
_BEST = 9.8


def _movies(context: Context, report: Progress, tasks: Turning | None) -> list[Movie]:
    return movies(context, report, _BEST if tasks is None else tasks.tasks["A"].best)


def rows(found: Turning) -> list[Row | OfPlanar]:
    """Lines of both tables."""
    task, hopf = found.tasks["A"], found.hopf
    without = "; ".join(f"{each} (k1 = {each.spring:.3g})" for each in by_leg_yaw(found.without))
    return [
        *(_radius(found, letter) for letter in found.tasks),
        _rough(found),
        *(words for letter in found.tasks for words in _beside_robot(found, letter)),
        OfPlanar(statements.ARRIVAL, Result(value=task.time, unit="s", digits=1)),
        OfPlanar(statements.WITHOUT, Result(without)),
        OfPlanar(statements.HOPF, Result(counted(task, hopf))),
        OfPlanar(statements.HOPF_SPRINGS, Result(softest_minima(hopf, found.hopf_point)[0])),
    ]


def _radius(found: Turning, letter: str) -> Row:
    task, radius = printed.TASKS[letter], found.tasks[letter].target.radius
    quantity = f"task {letter} ({task.target}): radius of the circle to the target"
    result, verdict = Result(value=radius, unit="m", digits=3), agreement(task.radius.band.holds(radius))
    return Row(quantity, str(task.radius), result, task.source, verdict, "geometry alone, R/(2 sin ψ)")


def _beside_robot(found: Turning, letter: str) -> list[OfPlanar]:
    task, said = found.tasks[letter], statements.TASKS[letter]
    low, late = minima(task.criteria), minima(task.criteria, 1)
    words = [
        OfPlanar(said.k_hat, Result(value=found.laws.k_hat(task.target.radius)[0], unit=PAPER_UNIT, digits=1)),
        OfPlanar(said.outcomes, Result(outcome_words(task.criteria, span))),
    ]
    for name, statement in said.minima.items():
        (factor, unit), at = SCALES[name], low.sel(criterion=name)
        where = f"{factor * float(at['mean']):.3g} {unit} at k1 = {float(at['at']):.3g}"
        afterwards = f"after {printed.ARRIVAL} at {float(late['at'].sel(criterion=name)):.3g}"
        words.append(OfPlanar(statement, Result(f"{where} ({afterwards})", float(at["at"]), unit=PAPER_UNIT)))
    return words


def _rough(found: Turning) -> Row:
    usual, rough = minima(found.tasks["A"].criteria)["at"], minima(found.rough.criteria)["at"]
    pairs = [
        f"{title.partition(',')[0]} {float(usual.sel(criterion=name)):.1f} → {float(rough.sel(criterion=name)):.1f}"
        for name, title in CRITERION_NAMES.items()
    ]
    quantity = f"task A, disturbances {ROUGH:g} times as large: springs of the smallest criteria"
    remark = f"evaluated at {found.rough.time:.2f} s, the earliest arrival there"
    return unprinted(quantity, f"{', '.join(pairs)} {PAPER_UNIT}", printed.TURNING, remark)


TURNING: Section[Turning] = Section("turning", CHAPTER, "turning to targets", turning, rows, panels)
MOVIES: Section[list[Movie]] = Section(
    "movies", CHAPTER, "the paper's two movies", _movies, films=lambda films: films, needs=(TURNING,)
)
