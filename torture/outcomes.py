"""What can come of an attack, and how a command's ending is judged."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any


class Kind(Enum):
    """What came of an attack: the first three are what is promised, all others are faults."""

    ENDED = "ended well"
    REFUSED = "refused"
    STOPPED = "stopped"
    TRACEBACK = "traceback"
    CODE = "exit code"
    LINES = "lines"
    FIELD = "no field"
    SILENT = "silent"
    LEFT = "left over"
    WRONG = "wrong"
    REPEATED = "repeated"
    CRASH = "crash"


FINE = (Kind.ENDED, Kind.REFUSED, Kind.STOPPED)
SENTENCES = {
    Kind.ENDED: "exit code 0, or a damaged file noticed, and the right result",
    Kind.REFUSED: "exit code 2, and one line that names the field",
    Kind.STOPPED: "went on for long, said how far, and ended at Ctrl-C with one line and 130",
    Kind.TRACEBACK: "a traceback, or a fault of its own",
    Kind.CODE: "another exit code",
    Kind.LINES: "more than one line, none, or a warning that leaked",
    Kind.FIELD: "a line that names no field",
    Kind.SILENT: "nothing said for 10 s of computing, or deaf to Ctrl-C",
    Kind.LEFT: "a file or folder half-written, or left behind",
    Kind.WRONG: "a wrong result accepted",
    Kind.REPEATED: "work lost, or done twice",
    Kind.CRASH: "died in native code",
}


@dataclass(frozen=True)
class Outcome:
    """What came of an attack, and what is to be known about it in one line."""

    kind: Kind
    said: str = ""


class FoundFault(Exception):
    """An attack got through."""

    def __init__(self, kind: Kind, said: str) -> None:
        super().__init__(said)
        self.kind, self.said = kind, said


@dataclass(frozen=True)
class Ending:
    """How a command ended: exit code (negative: killed by a signal), what it printed, what escaped it if anything."""

    code: int | None
    out: str
    err: str
    escaped: str = ""


# Ctrl-C where Python can raise nothing: the command's own process ends there at once, which one of many in a worker
# cannot.
_UNRAISED = re.compile(r"^Exception ignored [^\n]*\n(?:[^\n]*\n)*?KeyboardInterrupt", re.MULTILINE)
# What may stand on stderr beside an error.
_SAID = re.compile(
    r"^(?:[^:]+: +\d+ (?:%|s|min|h).*|The page is .*|no browser could be started: open .*|"
    r"note: .*|wrote .*|kept .*|the controller took .*|"
    r".*: walked again; .*|.*: [a-z ]+ are not kept: .*|[^:]+: compiling, once on this machine|"
    r"Invalid -W option ignored: .*|)$"  # Python says this of PYTHONWARNINGS before anything of ours runs
)
_FIELD = re.compile(
    r"--[a-z0-9]|\b(?:body|springs|legs|gait|ground|twin|provenance)\b|"
    r"""(?:^error: |: )(?:[^\W\d]|['"])[^ :]*(?: = .*?)?: (?!/)|"""
    r"[Nn]o such command|extra argument|[Mm]issing (?:argument|option|command)|"
    r"/branch\.nc: |at line \d+|no such preset or file|'[A-Z\[\]]+'"
)


def judged(
    ending: Ending,
    before: Mapping[str, object],
    after: Mapping[str, object],
    *,
    named: Iterable[str] = (),
    codes: Iterable[int] = (0,),
    interrupted: bool = False,
    stays: bool = True,
    printed: str = "",
) -> Kind:
    """What came of a command.

    Parameters
    ----------
    ending
        How it ended.
    before, after
        What was in the folders, see :func:`in_process.snapshot`.
    named
        Words of which one is as good as a field, such as the file that was damaged.
    codes
        Exit codes of success.
    interrupted
        Whether it was sent Ctrl-C.
    stays
        Whether a refused command leaves all as it was.
    printed
        What may be on stdout although it was refused: a result that cannot be written is printed all the same.

    Raises
    ------
    FoundFault
        If something is not as promised.
    """
    if interrupted and _UNRAISED.search(ending.err):
        return Kind.STOPPED
    if ending.escaped:
        raise FoundFault(Kind.TRACEBACK, ending.escaped)
    lines = [line for line in ending.err.splitlines() if not _SAID.match(line)]
    said = " | ".join(lines)[:500]
    if "Traceback (most recent call last)" in ending.err or ending.code == 1:
        raise FoundFault(Kind.TRACEBACK, said)
    if ending.code is not None and ending.code < 0:
        raise FoundFault(Kind.CRASH, f"signal {-ending.code} {said}")
    left = [name for name in after if name not in before and is_temporary(name)]
    if left:
        raise FoundFault(Kind.LEFT, f"{left[0]} {said}")
    if ending.code in codes:
        if lines:
            raise FoundFault(Kind.LINES, said)
        return Kind.ENDED
    if ending.code == 130 and interrupted:
        if lines != ["error: interrupted"]:
            raise FoundFault(Kind.LINES, said)
        return Kind.STOPPED
    if ending.code != 2:
        raise FoundFault(Kind.CODE, f"exit code {ending.code} {said}")
    if len(lines) != 1 or not lines[0].startswith("error: ") or ending.out not in ("", printed):
        raise FoundFault(Kind.LINES, f"{said} {f'and on stdout {ending.out[:80]!r}' if ending.out else ''}")
    if not _FIELD.search(lines[0].replace("robot.toml: ", "")) and not any(name and name in lines[0] for name in named):
        raise FoundFault(Kind.FIELD, said)
    if stays and before != after:
        raise FoundFault(Kind.LEFT, f"{', '.join(changed(before, after))[:200]} after {said}")
    return Kind.REFUSED


def is_temporary(name: str) -> bool:
    """Whether a path in a snapshot is none that anybody asked for."""
    return name.startswith("tmp/") or ".chilopod-" in name or name.endswith((".tmp", ".part"))


def changed(before: Mapping[str, object], after: Mapping[str, object]) -> Iterator[str]:
    """What two snapshots differ in."""
    for name in sorted({*before, *after}):
        if before.get(name) != after.get(name):
            yield f"{'new' if name not in before else 'gone' if name not in after else 'changed'} {name}"


def strict_json(text: str) -> Any:
    """Read one JSON object; NaN and infinity are a fault."""

    def refuse(name: str) -> float:
        raise FoundFault(Kind.WRONG, f"{name} in JSON")

    try:
        return json.loads(text, parse_constant=refuse)
    except ValueError as error:
        raise FoundFault(Kind.WRONG, f"no JSON: {error}") from None
