"""Folder of a report: its page, which appears at once and fills as sections are computed, and its films."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Event, Thread
from typing import Any, TypeVar

from chilopod.errors import OutputError
from chilopod.output import check_files, check_folder, write_atomic
from chilopod.paper.ahead import Studio
from chilopod.paper.curved.sections import CURVED
from chilopod.paper.duration import Plan
from chilopod.paper.page.headline import pitchfork
from chilopod.paper.page.page import Drawings, Drawn, Film, Shown, State, page
from chilopod.paper.robot.sections import WALKS
from chilopod.paper.section import Context, Found, Movie, Section, SectionProgress, Size, nothing
from chilopod.paper.straight import schematic
from chilopod.record import load_xarray
from chilopod.robot import load_robot, presets
from chilopod.show import style
from chilopod.show.files import panel_files
from chilopod.show.panel import Panel
from chilopod.show.scene import film, film_3d
from chilopod.show.scene.encoder import has_encoder
from chilopod.show.scene.replay import replay

T = TypeVar("T")

_HOLDS = re.compile('<meta name="chilopod-report" content="([A-Z]+)([^"]*)">')
_FRONT = 1000  # characters of a page, in which that stands
_BESIDE = ("data", "figures", "movies")
_NEWS, _BETWEEN_NEWS = "news.js", 3.0  # s


class Report:
    """Page that opens from disk, needs no other file, and is complete HTML at any time.

    Beside ``index.html`` there are ``figures/NAME.png`` and ``.svg``, ``data/NAME.csv`` and ``.nc`` for every figure,
    ``movies/NAME.mp4`` and ``.html``, and ``data/robot.toml`` and ``robot-3d.toml``. Files of these names are replaced,
    each as a whole. If films cannot be encoded, there are replays only.

    As a context manager it writes the page on entry and completes it on exit. Meanwhile ``news.js`` announces new
    results. Figures are drawn in a thread beside the computation of the next section, films in the process of a
    ``studio`` if there is one, and ``progress`` receives the fraction drawn. The page begins with ``plan``, and when it
    is done with the duration in place of the expected one. It creates a missing folder.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """

    def __init__(
        self,
        sections: Sequence[Section[Any]],
        context: Context,
        folder: str | Path,
        progress: SectionProgress = lambda what, done, words: None,
        plan: Plan | None = None,
        studio: Studio | None = None,
    ) -> None:
        self.page = check_folder(folder) / "index.html"
        self.failures: dict[Section[Any], Exception] = {}
        """Reasons of sections that could not be computed or drawn."""
        self._sections, self._progress, self._plan = sections, progress, plan
        self._found = Found(context)
        self._opening: list[Drawn] = []
        self._headline: Drawn | None = None
        self._written, self._over = 0, Event()
        self._shown: dict[Section[Any], Shown] = {}
        self._films: list[tuple[Section[Any], Movie]] = []
        self._added = self._drawn = 0
        self._stopped, self._studio = False, studio
        self._thread = ThreadPoolExecutor(1, "drawing")

    def __enter__(self) -> Report:
        load_xarray()  # this thread makes datasets too
        self._begun = time.perf_counter()
        self._write(State.RUNNING)
        self._opened = self._thread.submit(self._open)
        self._alive = Thread(target=self._tell, daemon=True)
        self._alive.start()
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._stopped = error is not None
        if self._studio is not None and self._stopped:
            self._studio.end(at_once=True)
        self._thread.shutdown(cancel_futures=self._stopped)
        self._over.set()
        self._alive.join()
        if self._studio is not None:
            self._studio.end()
        try:
            if error is None:
                self._progress("figures and films", 1.0, "done")
                self._write(State.DONE)
                self._opened.result()
            else:
                with suppress(OutputError):
                    self._write(State.STOPPED)
        finally:
            with suppress(OSError):
                (self.page.parent / _NEWS).unlink()

    def _tell(self) -> None:
        """Write every few seconds the number of the page, and that the computation goes on, into a file beside it."""
        told = False
        while not told:
            with suppress(OutputError):
                write_atomic(self.page.parent / _NEWS, f"chilopodNews({self._written}, {time.time():.0f});\n")
            told = self._over.wait(_BETWEEN_NEWS)

    def add(self, found: Found, sections: Collection[Section[Any]]) -> None:
        """Show sections that were computed or failed; return at once."""
        self._added += 1
        if self._studio is not None and any(each.films is not nothing for each in sections):
            self._studio.begin()
        self._thread.submit(self._add, found.copy(), sections)

    def _open(self) -> None:
        """Draw the robot, which needs no computation."""
        panel = schematic.panel(self._found.context.robot)
        self._opening = [_again(partial(self._draw_panel, panel))]
        self._draw_headline(self._found, self._sections)
        self._write_if_possible()

    def _add(self, found: Found, sections: Collection[Section[Any]]) -> None:
        self._found = found
        self.failures |= found.failures
        self._write_if_possible()
        self._draw_headline(found, sections)
        for section in self._sections:
            new = section in sections
            if section in found.values and (new or any(each in sections for each in section.beside)):
                self._try(section, partial(self._draw, section, found, new))
        self._drawn += 1
        self._write_if_possible()
        self._progress("figures and films", self._drawn / (len(self._sections) + 1), "")
        # Films take long, and wait while there is anything else to draw; first comes that which the page begins with.
        while self._films and self._added == self._drawn and not self._stopped:
            section, movie = max(reversed(self._films), key=lambda each: bool(each[1].stills))
            self._try(section, partial(self._film, section, movie))
            self._films.remove((section, movie))
            self._write_if_possible()

    def _draw_headline(self, found: Found, sections: Collection[Section[Any]]) -> None:
        """Draw the first figure of the page, if some of the sections belong to it."""
        if CURVED in sections or WALKS in sections:
            panel = pitchfork(found.context.robot, found[CURVED], found[WALKS])
            self._headline = _again(partial(self._draw_panel, panel))

    def _try(self, section: Section[Any], draw: Callable[[], Shown]) -> None:
        try:
            self._shown[section] = _again(draw)
        except Exception as error:
            if not self._stopped:
                self.failures[section] = error

    def _draw(self, section: Section[Any], found: Found, new: bool) -> Shown:
        figures = tuple(self._draw_panel(panel) for panel in section.figures(found))
        if not new and section in self._shown:
            return replace(self._shown[section], figures=figures)
        self._films += ((section, movie) for movie in section.films(found[section]))
        return Shown(section, figures, ())

    def _film(self, section: Section[Any], movie: Movie) -> Shown:
        shown, work = self._shown[section], partial(write_movie, movie, self.page.parent / "movies")
        drawn = work() if self._studio is None else self._studio.do(work)
        return replace(shown, films=(*shown.films, drawn))

    def _draw_panel(self, panel: Panel) -> Drawn:
        folder = self.page.parent
        files = dict(panel_files(panel, folder / "figures", folder / "data"))
        for path, content in files.items():
            write_atomic(path, content)
        with style.house_style():
            narrow = style.svg(panel.draw(True), panel.name)
        return Drawn(panel, files[folder / "figures" / f"{panel.name}.svg"], narrow)

    def _write_if_possible(self) -> None:
        # Whoever deletes files while it runs does not stop it; whether the page can be written counts at the end.
        with suppress(OutputError):
            self._write(State.RUNNING)

    def _write(self, state: State) -> None:
        context, data = self._found.context, self.page.parent / "data"
        robot_file = data / "robot.toml"
        robot = context.robot
        is_preset = robot.name in presets() and load_robot(robot.name) == robot
        shown = [self._shown[each] for each in self._sections if each in self._shown]
        waiting = [section for section in self._sections if section not in self._found]
        waiting += [section for section, _ in self._films]
        drawings = Drawings(self._headline, self._opening, shown, self.failures, waiting)
        taken = time.perf_counter() - self._begun if state is State.DONE else None
        said = "" if self._plan is None else self._plan.words(taken)
        html = page(self._found, self._sections, drawings, robot.name if is_preset else str(robot_file), state, said)
        self._written += 1
        write_atomic(self.page, html)  # first: what is beside it is known by it to be ours
        write_atomic(robot_file, context.robot.to_toml())
        write_atomic(data / "robot-3d.toml", context.whole.to_toml())


def _again(draw: Callable[[], T]) -> T:
    """Draw; draw again if the folder was deleted meanwhile."""
    try:
        return draw()
    except OutputError:
        return draw()


def check_report(folder: Path, sections: Collection[Section[Any]], size: Size, *, replace: bool = False) -> None:
    """Check, before any work, that a report of some sections and size can be written into a folder; an existing report
    with no more sections is replaced.

    Raises an OutputError if the folder cannot be written. Raises one too for a page that is not a report, a report with
    more sections, or files without a page, unless these may be replaced.
    """
    page = folder / "index.html"
    held = _held(page)
    check_files([page], replace=replace or held is not None)
    if replace:
        return
    if held is None:
        for beside in _BESIDE:
            if (folder / beside).is_dir() and any((folder / beside).iterdir()):
                problem = "has files that are of no report and might be replaced, which takes --force"
                raise OutputError(problem, source=str(folder / beside))
        return
    (done, names), sizes = held, list(Size)
    kept = [section for section in sections if section.name in names]
    larger = any(sizes.index(done.within(each)) < sizes.index(size.within(each)) for each in kept)
    more = [f"it is {done.name.lower()}"] if larger else sorted({*names} - {section.name for section in kept})
    if more:
        problem = f"is a report that has more ({', '.join(more)}) and is only replaced with --force"
        raise OutputError(problem, source=str(page))


def _held(page: Path) -> tuple[Size, list[str]] | None:
    """Size and sections of a report; None if it is none."""
    if not page.is_file():
        return None
    with page.open(encoding="utf-8", errors="replace") as file:
        found = _HOLDS.search(file.read(_FRONT))
    return (Size[found[1]], found[2].split()) if found and found[1] in Size.__members__ else None


def write_movie(shown: Movie, folder: Path) -> Film:
    """Write a movie as ``NAME.html``, ``NAME.mp4`` where films can be encoded and, of some moments of it in 3-D,
    ``NAME.png`` where it can be rendered."""
    replay(shown.record, titles=shown.titles, heading=shown.heading).write(folder / f"{shown.name}.html", replace=True)
    look: dict[str, Any] = {name: getattr(shown, name) for name in ("titles", "heading", "speed", "fps", "follow")}
    file, first, encoded = folder / f"{shown.name}.mp4", folder / f"{shown.name}-poster.png", has_encoder()
    solid, flat = film_3d.Film3D(shown.record, **look), film.Film(shown.record, **look, size=shown.size)
    rendered = encoded and "pose" in shown.record and _rendered(first, solid.poster)
    if encoded and not (rendered and _rendered(file, solid.mp4)):
        write_atomic(first, flat.poster())
        write_atomic(file, flat.mp4())
    picture = folder / f"{shown.name}.png"
    moments = partial(film_3d.stills, shown.record, shown.stills, titles=shown.titles)
    pictured = bool(shown.stills) and _rendered(picture, moments)
    return Film(shown.name, shown.heading, shown.speed, encoded, pictured)


def _rendered(path: Path, render: Callable[[], bytes]) -> bool:
    """Write the picture if OpenGL can render it; return False if not. The film from above needs no OpenGL."""
    try:
        write_atomic(path, render())
    except OutputError:
        return False
    return True
