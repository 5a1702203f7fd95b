"""Options of commands that let robots walk, with controllers and engines of users: search path, progress and share of
the time."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from chilopod.cli.options import EngineOption, RobotOptions, deliver, free, print_result
from chilopod.cli.progress import progress_bar
from chilopod.errors import ChilopodError, nearest_name

if TYPE_CHECKING:
    from chilopod import tasks
    from chilopod.progress import Progress
    from chilopod.tasks.walk import Runs

Found = TypeVar("Found", bound="Runs")

_SLOW = 0.5  # of the time of walks
_NOTICED = 1.0  # s

ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="ADDRESS|N",
        help="Dask cluster on which trials walk: address of its scheduler, or number of worker processes here.",
    ),
]


@dataclass(frozen=True)
class WalkOptions(RobotOptions):
    """Argument and options that walk, turn and course share, as they were typed."""

    seed: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=0,
            help="Seed of small random disturbances of start, feet and sensor; the same seed gives the same walk. "
            "Without it nothing is disturbed.",
        ),
    ] = None
    repeats: Annotated[
        int, typer.Option(metavar="N", min=1, max=100_000, help="Number of walks; their seeds count up from --seed.")
    ] = 1
    engine: EngineOption = "planar"
    controller: Annotated[
        str | None,
        typer.Option(metavar="MODULE:CLASS", help="Controller of your own, from this folder or an installed package."),
    ] = None
    trials: Annotated[
        Path | None,
        typer.Option(
            "--trials",
            metavar="FOLDER",
            help="Folder that keeps all trials; a trial that is there already is not walked again.",
        ),
    ] = None
    cluster: ClusterOption = None

    @property
    def steering(self) -> dict[str, Any]:
        """Engine and controller, arguments of every task and of a trial; refuses unknown ones."""
        from chilopod.engine import controller_named, engine_named

        engine_named(self.engine)
        own = None if self.controller is None else controller_named(self.controller)
        return {"engine": self.engine, "controller": own}

    def runs(self, progress: Progress) -> tasks.RunOptions:
        """Options of every task, with the function that shows its progress."""
        return {"seed": self.seed, "repeats": self.repeats, "folder": self.trials, "progress": progress}

    def spring(self, path: str | None, k1: str, *words: str) -> float:
        """Stiffness of ``--k1`` for the springs that a strategy softens, N*m/rad; errors name words that it may be."""
        path = path or "springs.stiffness"
        try:
            return self.described.override(path, k1).get(path)
        except ChilopodError as error:
            error.field, error.nearest = "k1", error.nearest or nearest_name(str(error.value), words)
            error.allowed = ", ".join(filter(None, (*words, error.allowed))) or None
            raise

    @contextmanager
    def walking(self, what: str) -> Iterator[Callable[[str], Progress]]:
        """Find the user's modules, walk on the cluster that was named, and show progress under titles, in this
        block."""
        with progress_bar(what) as show, own_code(show), walking_on(self.cluster):
            yield lambda title: partial(show, title)

    def walk_into(self, out: Path | None, what: str, walk: Callable[[Callable[[str], Progress]], Found]) -> None:
        """Walk a ``turn`` or a ``course``, write its files into the folder, if there is one, and print it."""
        if out:
            from chilopod.show.files import files_of_walks

            free(files_of_walks(what, out), self.force)
        with self.walking(what) as progress:
            done = walk(progress)

        def write() -> Iterable[Path]:
            from chilopod.show.files import write_walks

            return write_walks(what, done, out or "", replace=self.force)

        self.deliver(write if out else list, done)

    def deliver(self, write: Callable[[], Iterable[Path]], done: Found, hint: str = "--seed 1") -> None:
        """Write the files of walks, and print what they came to, as JSON where that was asked for; of walks that
        nothing bends the hint says which options do."""

        def printed() -> None:
            with progress_bar("creep of the feet"):  # may take as long as the walk
                creeps = done.foot_creep
            lines = done.lines()
            if getattr(done, "straight", False):
                lines.append(f"  nothing disturbed it, so nothing bends it, even where it is unstable: try {hint}")
            if creeps is not None:
                lines.append(f"  standing feet creep like viscous ones of {float(f'{creeps:.3g}'):g} N*s/m")
            print_result(done.as_json(), lines, self.as_json)

        deliver(write, printed)


@contextmanager
def walking_on(cluster: str | None) -> Iterator[None]:
    """Let trials of this block walk where ``--cluster`` says."""
    if cluster is None:
        yield
        return
    from chilopod.trials import Cluster, using

    is_number = cluster.lstrip("-").isdecimal()
    with Cluster(int(cluster[:9]) if is_number else cluster) as there, using(there):
        yield


@contextmanager
def own_code(show: Callable[[str, float, str], None]) -> Iterator[None]:
    """Find modules in the current folder too, after all others; show how far walks are that are under way; and say at
    the end if controllers took most of the time. Output of user code goes to stderr, because stdout has the result."""
    from chilopod.engine import watched

    here = os.getcwd()
    added = here not in sys.path and "" not in sys.path
    if added:
        sys.path.append(here)
    streams, stdout = (sys.stdout, sys.stderr), os.dup(1)
    try:
        # The streams of Python, and those of processes that it starts.
        streams[0].flush()
        os.dup2(2, 1)
        sys.stdout = sys.stderr
        with watched(lambda done, words: show("under way", done, words)) as spent:
            yield
    finally:
        sys.stdout, sys.stderr = streams
        os.dup2(stdout, 1)
        os.close(stdout)
        if added:
            sys.path.remove(here)
    if spent.share > _SLOW and spent.controller > _NOTICED:
        share, seconds = f"{100.0 * spent.share:.0f} %", f"{spent.controller:.1f} s"
        typer.echo(f"the controller took {share} of the time of all walks, {seconds}", err=True)
