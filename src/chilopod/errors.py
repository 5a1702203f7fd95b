"""The exceptions a user of chilopod can meet.

Each one says in a single line which field is wrong, what was given, what is allowed and, for a misspelt name, which
valid name is nearest. The command line prints that line and exits with code 2.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_LONGEST_VALUE = 60
_LONGEST_NAME = 200


class ChilopodError(Exception):
    """Base of all errors chilopod raises on purpose.

    Each has the problem in a few words; and as far as they are known the dotted name of what is wrong, such as
    ``body.mass``, the value that was given, the values that are allowed in words, the valid name nearest to the one
    given, and the source, the file it stands in.
    """

    def __init__(
        self,
        problem: str = "",
        *,
        field: str | None = None,
        value: object = None,
        allowed: str | None = None,
        nearest: str | None = None,
        source: str | None = None,
    ) -> None:
        super().__init__(problem)
        self.problem = problem
        self.field = field
        self.value = value
        self.allowed = allowed
        self.nearest = nearest
        self.source = source

    def __str__(self) -> str:
        subject = None if self.field is None else _cut(self.field, _LONGEST_NAME) or "''"
        if self.value is not None:
            subject = f"{subject} = {_brief(self.value)}" if subject else _brief(self.value)
        source = None if self.source is None else _cut(self.source, _LONGEST_NAME)
        text = ": ".join(part for part in (source, subject, self.problem) if part)
        if self.nearest:
            text = f"{text}; did you mean {self.nearest!r}?"
        if self.allowed:
            text = f"{text}{'' if self.nearest else ';'} allowed: {self.allowed}"
        return one_line(text)


class RobotFileError(ChilopodError, ValueError):
    """A robot file is missing, unreadable, or describes no valid robot."""


class UnitError(ChilopodError, ValueError):
    """A quantity cannot be read: no number, an unknown unit, a wrong dimension, NaN or infinity."""


class ParameterError(ChilopodError, ValueError):
    """An argument or a parameter path names nothing usable, or its value is out of range."""


class OutputError(ChilopodError, OSError):
    """A result cannot be written where it should go."""


class AnalysisError(ChilopodError, RuntimeError):
    """A computation cannot deliver what was asked of it."""


class ExtraError(ChilopodError, ImportError):
    """Something takes a package that an extra brings, and the extra is not installed."""


class ThreadError(ChilopodError, RuntimeError):
    """Two threads are within a thing at the same time that belongs to one."""


class ClusterError(ChilopodError, RuntimeError):
    """A cluster is not there, is not what this machine is, or went away."""


def nearest_name(name: str, valid: Iterable[str]) -> str | None:
    """Return the member of `valid` most like `name`, or None when none is alike.

    Letter case does not count, and of two names equally alike the first one wins.
    """
    # difflib is quadratic in the length of its input, and nobody mistypes a name this long.
    if len(name) > _LONGEST_VALUE:
        return None
    folded: dict[str, str] = {}
    for candidate in valid:
        folded.setdefault(candidate.casefold(), candidate)
    alike = difflib.get_close_matches(name.casefold(), folded, n=1, cutoff=0.6)
    return folded[alike[0]] if alike else None


def one_line(text: str) -> str:
    """Return `text` as one printable line: white space collapsed, control characters and surrogates escaped."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(text.split()))


def in_words(error: BaseException) -> str:
    """Return the kind of an exception of somebody else's and what it says, as one line."""
    try:
        said = str(error)
    except Exception:  # one that cannot even be printed
        said = ""
    return one_line(f"{type(error).__name__}: {said}" if said else type(error).__name__)


def briefly(error: BaseException) -> str:
    """As :func:`in_words`, but of what it says the first line only: others explain at length."""
    words = str(error).strip().partition("\n")[0]
    return one_line(f"{type(error).__name__}: {words}" if words else type(error).__name__)


def _brief(value: object) -> str:
    try:
        text = repr(value)
    except (ValueError, RecursionError):
        # An integer of more than 4300 digits or a table nested a thousand deep has no repr, but is still a bad value.
        text = f"<{type(value).__name__}>"
    return _cut(text, _LONGEST_VALUE)


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[: longest - 3]}..."
