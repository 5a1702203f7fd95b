"""Page of the report: one HTML file that needs no other file."""

from __future__ import annotations

import platform
import re
import time
from base64 import b64encode
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from importlib.metadata import version
from typing import Any, Final

from markupsafe import Markup, escape

from chilopod import units
from chilopod.errors import in_words
from chilopod.paper.section import Found, Section
from chilopod.paper.straight.sections import MODE, UNIFORM
from chilopod.paper.table import Kind, RobotRow, Row, Verdict, at_once
from chilopod.paper.turning.sections import TURNING
from chilopod.paper.turning.trials import outcome_words, span
from chilopod.robot import Robot
from chilopod.show.panel import Panel
from chilopod.show.templates import template
from chilopod.show.words import SPRING_UNIT, listing, minus, spring, typeset

_TITLE: Final = "A robot that turns by bifurcation: the paper and the computation"
_LOOKS: Final = {
    **dict.fromkeys((Verdict.AGREES, Verdict.WITHIN), ("agrees", "✓")),
    **dict.fromkeys((Verdict.DIFFERS, Verdict.OUTSIDE), ("differs", "≠")),
    Verdict.UNDECIDED: ("undecided", "?"),
    Verdict.NOT_DETERMINED: ("undetermined", "∅"),
    **dict.fromkeys((Verdict.NOT_PRINTED, Verdict.NOT_COMPUTED), ("open", "–")),
}
"""Class and mark of each verdict."""

_COUNTED: Final = {
    "agrees": "agree",
    "undecided": "undecided",
    "differs": "differ",
    "undetermined": "not determined",
    "more": "need more trials",
}
"""Words under which verdicts are counted, by class."""

_MET: Final = {
    Verdict.WITHIN: "met",
    Verdict.OUTSIDE: "not met",
    Verdict.UNDECIDED: "undecided by the scatter of its trials",
    Verdict.NOT_DETERMINED: "not determined by its trials",
}
"""Words of the summary for verdicts on the robot in three dimensions."""

_LIBRARIES: Final = ("numpy", "numba", "scipy", "xarray", "matplotlib")


@dataclass(frozen=True)
class Drawn:
    """A figure in both layouts, as SVG."""

    panel: Panel
    wide: bytes
    narrow: bytes


@dataclass(frozen=True)
class Film:
    """A film beside the page: name of its files, title, seconds of the walk per second of the film, and whether there
    is an mp4 beside the replay with its poster, and a png with moments of it."""

    name: str
    title: str
    speed: float
    encoded: bool
    pictured: bool = False


@dataclass(frozen=True)
class Shown:
    """Drawings of a section."""

    section: Section[Any]
    figures: Sequence[Drawn]
    films: Sequence[Film]


@dataclass(frozen=True)
class Drawings:
    """Drawings of a report so far: first figure of the page, figures of the robot itself, which open the first chapter,
    and those of the sections; sections that failed, with the reason, and sections that wait."""

    headline: Drawn | None = None
    opening: Sequence[Drawn] = ()
    shown: Sequence[Shown] = ()
    failures: Mapping[Section[Any], Exception] = field(default_factory=dict)
    waiting: Collection[Section[Any]] = ()


class State(Enum):
    """State of a report: still computed, complete, or stopped early."""

    RUNNING = "running"
    DONE = "done"
    STOPPED = "stopped"


def page(
    found: Found,
    sections: Sequence[Section[Any]],
    drawings: Drawings,
    robot_file: str,
    state: State = State.DONE,
    plan: str = "",
) -> str:
    """The page as HTML, which loads new results while the report is running.

    Figures and films stand in their chapters, those with a letter first. ``robot_file`` is the name of the robot in
    commands: a preset, or the path of a file.
    """
    mode = found[MODE]
    tables = {chapter: [_row(row) for row in rows] for chapter, rows in found.planar_rows().items()}
    # Nothing is left out before all has been tried.
    robot_rows = [_row(replace(row, absent="") if drawings.waiting else row) for row in found.robot_rows()]
    looks = Counter(row["look"] for rows in (*tables.values(), robot_rows) for row in rows)
    return template("chilopod.paper.page", "page.html.j2").render(
        title=_TITLE,
        holds=" ".join([found.context.size.name, *(section.name for section in found.values)]),
        embedded=_embedded,
        state=state.value,
        plan=Markup(re.sub(r"--\w+", r"<code>\g<0></code>", str(escape(plan)))),
        written=time.time(),
        done=sum(section in found for section in sections),
        count=len(sections),
        summary=summary(found),
        counted=[(look, word, looks[look]) for look, word in _COUNTED.items() if looks[look]],
        headline=drawings.headline,
        first=_first([film for each in drawings.shown for film in each.films]),
        tables=tables,
        robot_rows=robot_rows,
        at_once=typeset(at_once(found.robot_rows())),
        chapters=_chapters(sections, drawings),
        robot=f'"{robot_file}"' if " " in robot_file else robot_file,
        soft=10.0 if mode is None else float(f"{0.8 * mode.attrs['value']:.2g}"),
        robots=_robots(found),
        versions=listing(
            [f"chilopod {version('chilopod')}", f"Python {platform.python_version()}"]
            + [f"{name} {version(name)}" for name in _LIBRARIES]
        ),
        seconds=", ".join(f"{section.sentence} {value:.1f}" for section, value in found.seconds.items()),
    )


def summary(results: Found) -> str:
    """Findings, in five plain sentences at most."""
    parts, mode, uniform, turning = [], results[MODE], results[UNIFORM], results[TURNING]
    modules = results.context.robot.body.modules
    parts.append(
        f"A {modules}-module robot walks straight as long as the springs between its modules are "
        "stiff enough; below a critical stiffness the straight walk cannot hold, and the body bends by itself."
    )
    if mode is not None:
        found = mode.attrs
        parts.append(
            f"Softening the front spring alone, that happens at {spring(found['value'], 5)}: a {found['criticality']} "
            f"{found['kind']}, and the robot turns left or right."
        )
    if uniform is not None:
        found = uniform.attrs
        parts.append(
            f"Softening all springs together, it happens at {spring(found['value'], 5)} and the body undulates, once "
            f"in {found['oscillation_period_s']:.1f} s."
        )
    if turning is not None:
        task = turning.tasks["A"]
        parts.append(
            f"Sent to a target at {task.target}, it comes nearest with a front spring of {spring(task.best, 3)}; most "
            f"walks have {outcome_words(task.criteria, span)}\u00a0{SPRING_UNIT}."
        )
    predicted = [row.verdict for row in results.robot_rows() if row.twin and row.kind == Kind.PREDICTED.value]
    if predicted:
        count = len(predicted)
        met = [f"{predicted.count(each)} {words}" for each, words in _MET.items() if each in predicted]
        parts.append(
            "The same robot in three dimensions, its unknown constants fitted to the paper's base series of walks and "
            f"their speed alone, is compared with {count} other statement{'s' * (count != 1)} about it: {listing(met)}."
        )
    return " ".join(parts)


def _first(films: Sequence[Film]) -> Film | None:
    """First film of the page: that of the robot in three dimensions, if there is one."""
    return next(
        (film for film in reversed(films) if film.pictured), next((film for film in films if film.encoded), None)
    )


def _chapters(sections: Sequence[Section[Any]], drawings: Drawings) -> list[dict[str, Any]]:
    chapters: list[dict[str, Any]] = []
    failures = drawings.failures
    for number, title in enumerate(dict.fromkeys(section.chapter for section in sections), 1):
        here = [each for each in drawings.shown if each.section.chapter == title]
        figures = [drawn for each in here for drawn in each.figures]
        planned = [section for section in sections if section.chapter == title]
        chapters.append(
            {
                "title": title,
                "anchor": f"chapter-{number}",
                "figures": sorted(figures, key=lambda drawn: drawn.panel.letter),
                "films": [film for each in here for film in each.films],
                "coming": [each.sentence for each in planned if each in drawings.waiting],
                "failed": {each.sentence: in_words(failures[each]) for each in planned if each in failures},
            }
        )
    for first in chapters[:1]:
        first["figures"][:0] = drawings.opening
    return chapters


def _row(row: Row | RobotRow) -> dict[str, str]:
    look, mark = _LOOKS[row.verdict]
    texts = {name: typeset(text) for name, text in row.data().items() if isinstance(text, str)}
    if isinstance(row, RobotRow) and row.absent and not row.twin:
        return {**texts, "look": "more", "mark": "…", "verdict": row.absent}
    return {**texts, "look": look, "mark": mark}


def _embedded(svg: bytes) -> str:
    return "data:image/svg+xml;base64," + b64encode(svg).decode("ascii")


def _robots(results: Found) -> list[dict[str, Any]]:
    """Robots of the report, with the files of their numbers."""
    found = [("The robot of the planar model", results.context.robot, "robot.toml")]
    if any(row.twin for row in results.robot_rows()):
        found.append(("The robot in three dimensions", results.context.whole, "robot-3d.toml"))
    return [{"says": says, "name": robot.name, "file": file, "numbers": _numbers(robot)} for says, robot, file in found]


def _numbers(robot: Robot) -> Iterator[tuple[str, str, str]]:
    """Path, value and origin of every number of a robot."""
    for path in robot.parameters():
        value = minus(units.format(robot.get(path), robot.unit_of(path), digits=6)).replace("*", "·")
        yield path, value, robot.provenance_of(path) or "not said"
