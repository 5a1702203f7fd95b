"""Everything the paper does with its robot and its planar model, done here and put beside what it prints."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from chilopod.errors import OutputError, ParameterError, nearest_name
from chilopod.paper.registry import load_sections
from chilopod.paper.section import Context, Found, Section

Progress = Callable[[str, float, str], None]
"""Called with what is done, the part of it that is (0 to 1), and a few words."""

SECTIONS: tuple[Section[Any], ...] = load_sections()
"""All sections in the order they are computed: the paper's own experiments, then what goes beyond them."""


def chosen(only: Iterable[str] | None = None, quick: bool = False, paper: bool = False) -> list[Section[Any]]:
    """The sections asked for, in the order they are computed.

    Parameters
    ----------
    only
        Their names; by default all but those that are computed on request.
    quick
        Without those that a quick report leaves out, unless they are named.
    paper
        Only the paper's own experiments.

    Raises
    ------
    ParameterError
        If one of them does not exist, or goes beyond the paper's own experiments though only these are asked for.
    """
    sections = {section.name: section for section in SECTIONS}
    if only is not None:
        asked = list(only)
        for name in asked:
            if name not in sections:
                raise ParameterError(
                    "no such section",
                    field="only",
                    value=name,
                    allowed=", ".join(sections),
                    nearest=nearest_name(name, sections),
                )
        found = [section for name, section in sections.items() if name in asked]
    else:
        found = [each for each in sections.values() if not each.on_request and not (quick and each.full)]
    for section in found if paper and only is not None else ():
        if section.beyond:
            raise ParameterError("goes beyond the paper's own experiments", field="only", value=section.name)
    return [section for section in found if not (paper and section.beyond)]


def reproduce(
    sections: Sequence[Section[Any]],
    context: Context | None = None,
    progress: Progress = lambda what, done, words: None,
    told: Callable[[Found, Section[Any]], None] = lambda found, section: None,
) -> Found:
    """Compute sections of the report; one that fails does not keep the others from being computed.

    Parameters
    ----------
    sections
        See :func:`chosen`.
    context
        By default the paper's robots.
    progress
        Called as the work goes on.
    told
        Called after every section with all that is found by then, and the section.

    Raises
    ------
    OutputError
        If trials cannot be kept.
    """
    found = Found(context or Context())
    for section in sections:
        started = time.perf_counter()
        progress(section.sentence, 0.0, section.sentence)

        def report(done: float, words: str, section: Section[Any] = section) -> None:
            progress(section.sentence, done, words)

        try:
            found.add(section, section.compute(found.context, found.seen_by(section.needs), report))
        except OutputError:  # where nothing can be written any more, no other section fares better
            raise
        except Exception as error:
            found.failures[section] = error
        found.seconds[section] = time.perf_counter() - started
        progress(section.sentence, 1.0, "failed" if section in found.failures else "done")
        told(found, section)
    return found
