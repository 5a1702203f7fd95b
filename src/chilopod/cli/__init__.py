"""The command line: parse, call, print, and nothing else.

Each command lives in a module of this package and imports what it needs when it runs, so that ``--help`` stays fast.
Results go to stdout, everything else to stderr. An error is one line on stderr and exit code 2.
"""

from __future__ import annotations

import logging
import os
import re
import sys
import traceback
from collections.abc import Sequence
from typing import Annotated

import typer

from chilopod.cli import doctor, identify, live, reproduce, robot, studies, theory, trials, walks
from chilopod.cli.commands import new_app
from chilopod.errors import ChilopodError, ParameterError, briefly, one_line
from chilopod.process import INTERRUPTED

USAGE_ERROR = 2
INTERNAL_ERROR = 1
_COMPLETION = "_CHILOPOD_COMPLETE"  # variable by which a shell asks for completions

app = new_app("Many-legged robots that turn by bifurcation: simulate, analyse and steer them.", completion=True)
app.command("reproduce", short_help="Repeat the paper, and write a report beside its numbers.")(reproduce.reproduce)
app.add_typer(robot.app, name="robot")
app.command("stability", short_help="Stability of the straight walk: its Floquet exponents.")(theory.stability)
app.command("bifurcation", short_help="Points at which the straight walk gives way, and how.")(theory.bifurcation)
app.command("branch", short_help="Curved walks beyond that point: how tightly they turn.")(theory.branch)
app.command("sensitivity", short_help="What each number of a robot does to where it bends.")(studies.sensitivity)
app.command("compare", short_help="Differing numbers of two robots, and the part of each.")(studies.compare)
app.command("size", short_help="Numbers of a robot at which it does what is wished.")(studies.size)
app.command("map", short_help="Map over two numbers: where it holds, bends or undulates.")(theory.stability_map)
app.command("walk", short_help="Let a robot walk, and report where it gets to.")(walks.walk)
app.command("turn", short_help="Pick the spring that leads to a target, and walk there.")(walks.turn)
app.command("course", short_help="Walk from target to target, and report on each.")(walks.course)
app.command("live", short_help="Watch a robot walk in the browser, and change it.")(live.live)
app.command("play", short_help="Write a page in which the planar robot walks in any browser.")(live.play)
app.add_typer(identify.app, name="identify")
app.add_typer(trials.app, name="trials")
app.command("doctor", short_help="Check the installation, and print what mends it.")(doctor.doctor)


@app.callback(invoke_without_command=True)
def _root(
    ctx: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback when something fails.")] = False,
) -> None:
    if version:
        import chilopod

        typer.echo(f"chilopod {chilopod.__version__}")
        raise typer.Exit
    if ctx.invoked_subcommand is None:
        typer.echo(ctx.get_help())


def _check_completion() -> None:
    instruction = os.environ.get(_COMPLETION, "")
    if instruction and not re.fullmatch(r"(complete|source)_(bash|zsh|fish|powershell|pwsh)", instruction):
        problem, allowed = "must be the instruction of a shell", "complete_bash, or unset"
        raise ParameterError(problem, field=_COMPLETION, value=instruction, allowed=allowed)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line on arguments, by default those of this process, and return its exit code.

    The code is 0, or 2 for anything the user can put right, 1 for a fault of chilopod, 3 where ``doctor`` finds that
    something essential is missing, 130 when interrupted.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    logging.getLogger("chilopod").disabled = True  # the progress bar says it
    trials_log, told = logging.getLogger("chilopod.trials.store"), list[str]()

    def is_new(line: logging.LogRecord) -> bool:  # a command may run several studies in one folder
        told.append(line.getMessage())
        return told.count(told[-1]) == 1

    trials_log.addFilter(is_new)
    try:
        _check_completion()
        code = app(arguments, prog_name="chilopod", standalone_mode=False)
    except (typer.Abort, KeyboardInterrupt):
        return _fail("interrupted", INTERRUPTED)
    except Exception as error:
        # Before the arguments are parsed there is no other way to know; a usage error is not parsed to the end.
        if "--debug" in arguments:
            raise
        # Usage errors have no public base class that all supported versions of typer share, but they all do this.
        if hasattr(error, "format_message"):
            context = getattr(error, "ctx", None)
            command = context.command_path if context else "chilopod"
            return _fail(f"{error.format_message()} (see {command} --help)", USAGE_ERROR)
        if isinstance(error, ChilopodError):
            return _fail(str(error), USAGE_ERROR)
        if isinstance(error, OSError):
            named = ChilopodError(error.strerror or str(error), source=str(error.filename or ""))
            return _fail(str(named), USAGE_ERROR)
        if isinstance(error, MemoryError):
            lacking = str(error) or "how much more it takes is not known"
            return _fail(f"there is too little memory ({lacking})", USAGE_ERROR)
        package = _not_imported(error)
        if package:
            return _fail(f"{package} cannot be imported: {briefly(error)} ({_mend(package)})", USAGE_ERROR)
        said = f"{type(error).__name__}: {error} (--debug shows more)"
        return _fail(f"this is a fault of chilopod, please report it: {said}", INTERNAL_ERROR)
    finally:
        trials_log.removeFilter(is_new)
    if code == INTERRUPTED:  # recent versions of typer make this of a KeyboardInterrupt
        return _fail("interrupted", INTERRUPTED)
    return code if isinstance(code, int) else 0


def _not_imported(error: Exception) -> str | None:
    """Name of another project's package that could not be imported, if the import failed."""
    frames = (frame for frame, _ in traceback.walk_tb(error.__traceback__))
    loading = (frame.f_globals.get("__name__", "") for frame in frames if frame.f_code.co_name == "<module>")
    packages = (name.partition(".")[0] for name in loading)
    missing = error.name if isinstance(error, ModuleNotFoundError) else None
    return next((package for package in packages if package not in ("chilopod", "__main__")), missing)


def _mend(package: str) -> str:
    wishes = doctor.settings(package)
    return f"without {', '.join(wishes)} in the environment it may" if wishes else "see chilopod doctor"


def _fail(message: str, code: int) -> int:
    print(f"error: {one_line(message)}", file=sys.stderr)
    return code
