"""Exceptions that users of chilopod can meet.

Each message is one line: the field that is wrong, the value given, the values allowed and, for a misspelt name, the
nearest valid name. The command line prints that line and exits with code 2.
"""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

_LONGEST_VALUE = 60
_LONGEST_NAME = 200


class ChilopodError(Exception):
    """Base of all errors chilopod raises on purpose.

    Each error has the problem in a few words and, as far as they are known, the dotted name of the wrong field, such as
    ``body.mass``, the value given, the values allowed in words, the valid name nearest to the given one, and the
    source, the file that has the field.
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
    """A result cannot be written where it should go; ``written`` are paths of its files that could be."""

    written: Collection[object] = ()


class AnalysisError(ChilopodError, RuntimeError):
    """A computation cannot deliver its result."""


class ExtraError(ChilopodError, ImportError):
    """A feature needs a package of an extra that is not installed."""


class ThreadError(ChilopodError, RuntimeError):
    """Two threads use an object at the same time that only one thread may use."""


class ClusterError(ChilopodError, RuntimeError):
    """A cluster does not answer, differs from this machine in its software, or was lost."""


@contextmanager
def concerning(field: str | None = None, *, within: str = "", source: str | None = None) -> Iterator[None]:
    """Errors of this block concern this field, or one within something, or are in this source."""
    try:
        yield
    except ChilopodError as error:
        error.field = error.field if field is None else field
        error.field = f"{within} {error.field or ''}".strip() if within else error.field
        error.source = error.source if source is None else source
        raise


def nearest_name(name: str, valid: Iterable[str]) -> str | None:
    """Return the member of `valid` most like `name`, or None when none is alike.

    Letter case does not count, and of two names equally alike the first one wins.
    """
    # difflib is quadratic in the length of its input, and misspelt names are never this long.
    if len(name) > _LONGEST_VALUE:
        return None
    folded: dict[str, str] = {}
    for candidate in valid:
        folded.setdefault(candidate.casefold(), candidate)
    alike = difflib.get_close_matches(name.casefold(), folded, n=1, cutoff=0.6)
    return folded[alike[0]] if alike else None


def known_names(
    names: Collection[str], known: Iterable[str], field: str, problem: str = "is not known"
) -> tuple[str, ...]:
    """Names without repetitions; ParameterError if there are none, and with the problem if one is not known."""
    known = tuple(known)
    if isinstance(names, str) or not names:
        raise ParameterError("must be names", field=field, value=names, allowed=", ".join(known))
    for name in names:
        if name not in known:
            near = nearest_name(str(name), known)
            raise ParameterError(problem, field=field, value=name, allowed=", ".join(known), nearest=near)
    return tuple(dict.fromkeys(names))


def one_line(text: str) -> str:
    """Return `text` as one printable line: white space collapsed, control characters and surrogates escaped."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(text.split()))


def in_words(error: BaseException) -> str:
    """Return type and message of an exception from foreign code, as one line."""
    try:
        message = str(error)
    except Exception:  # one that cannot even be printed
        message = ""
    return one_line(f"{type(error).__name__}: {message}" if message else type(error).__name__)


def briefly(error: BaseException) -> str:
    """Return type and first line of the message of an exception; some messages are long."""
    words = str(error).strip().partition("\n")[0]
    return one_line(f"{type(error).__name__}: {words}" if words else type(error).__name__)


def _brief(value: Any) -> str:
    try:
        # numpy's scalars as plain numbers
        text = repr(value.item() if getattr(value, "ndim", None) == 0 and hasattr(value, "item") else value)
    except (ValueError, RecursionError):
        # An integer of more than 4300 digits or a table nested a thousand deep has no repr, but is still a bad value.
        text = f"<{type(value).__name__}>"
    return _cut(text, _LONGEST_VALUE)


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[: longest - 3]}..."
