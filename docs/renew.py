"""Runs what README and docs show, writes what it prints into the pages, and keeps it: ``make renew``.

In a page these are results:

- What a block of ``sh`` shows below a command that begins with ``$ ``. A line of dots stands for lines left out.
- The comments at the end of a Python block behind ``<!-- run by make renew -->``: what it prints. (Python blocks
  without that are run by the tests.)
- Numbers of the text, if a comment before the paragraph or table says where they come from, in their order::

      <!-- chilopod bifurcation aoi2022-planar ... --json
           6.5756 = points > 0 > value -->

  A path leads through the printed JSON by keys, positions and names of rows; ``* 1000`` behind it scales the number,
  ``~ at (.*?) m`` takes its part of a text. A number is written with as many decimals as it had.

A table whose last columns are numbers of the rows that its first column names has one line for all of them::

      <!-- make torture
           rows = classes: seed, tried, faults -->

``make torture`` and the campaign of branches stand for what their last run counted: those minutes are not spent
again.

``make renew ARGS=docs/tutorial.md`` does so for some pages only.

``docs/results.json`` keeps the results with the version and the robots that they are of. The tests hold pages,
results and presets together, and run the quick commands again.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import re
import shlex
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import chilopod
from chilopod.cli import main
from chilopod.robot import load_robot, presets

DOCS = Path(__file__).resolve().parent
COUNTED = {
    "make torture": DOCS.parent / "torture" / "results.json",
    "python torture/branches.py --count 1000 --seed 1123": DOCS.parent / "torture" / "branches.json",
}
PAGES = (DOCS.parent / "README.md", *sorted(DOCS.rglob("*.md")))
RESULTS = DOCS / "results.json"
QUICK = 2.0
"""What takes no longer, in seconds of one processor, is run by the tests again."""

_SHOWN = re.compile(r"^```sh\n\$ (?P<command>chilopod [^\n]*)\n(?P<output>.*?)^```$", re.M | re.S)
_BLOCK = re.compile(
    r"^<!-- run by make renew -->\n```python\n(?P<command>.*?)(?P<output>(?:^# [^\n]*\n)+)```$", re.M | re.S
)
_NAMED = re.compile(
    r"^<!-- (?P<command>(?:chilopod|make|python) [^\n]*)\n(?P<names>.*?) -->\n+(?P<text>.*?)(?=\n\n|\Z)", re.M | re.S
)
_NAME = re.compile(r"^\s*(?P<text>\S.*?) = (?P<path>.*?)(?: \* (?P<scale>[\d.e]+))?(?: ~ (?P<part>.*))?$", re.M)


@dataclass(frozen=True)
class Number:
    """A number of the text and where it comes from."""

    text: str
    path: str
    scale: str | None
    part: str | None

    def renewed(self, value: Any) -> str:
        """The number as the text should have it."""
        if self.part is not None:
            found = re.search(self.part, value)
            return found[1] if found else f"nothing like {self.part}"
        return f"{value * float(self.scale or 1):.{len(self.text.partition('.')[2])}f}"


@dataclass(frozen=True)
class Result:
    """A place of a page that shows what a command or a block of Python printed."""

    place: re.Match[str]
    numbers: tuple[Number, ...] = ()

    @property
    def command(self) -> str:
        """As it is typed."""
        return self.place["command"]

    def taken(self, printed: str) -> Any:
        """What is kept of the printed text."""
        if not self.numbers:
            return printed.splitlines()
        table = json.loads(printed)
        return {number.path: _at(table, number.path) for number in self.numbers}

    def renewed(self, kept: Any) -> str:
        """The place with another result."""
        if self.numbers:
            return self._with_numbers(kept)
        lines = _without(kept, self.place["output"].splitlines())
        before = "" if self.command.startswith("chilopod ") else "# "
        return self._until("output") + "".join(f"{before}{line}\n" for line in lines) + "```"

    def _with_numbers(self, kept: dict[str, Any]) -> str:
        names, text, behind = self.place["names"], self.place["text"], 0
        for number in self.numbers:
            new = number.renewed(kept[number.path])
            at = re.compile(rf"(?<![\d.]){re.escape(number.text)}(?!\d|\.\d)").search(text, behind)
            if at is None:
                raise ValueError(f"the text does not have {number.text} where {self.command} is named: {text}")
            text, behind = text[: at.start()] + new + text[at.end() :], at.start() + len(new)
            names = names.replace(f"{number.text} = {number.path}", f"{new} = {number.path}", 1)
        start = self.place.start()
        between = self.place[0][self.place.end("names") - start : self.place.start("text") - start]
        return self._until("names") + names + between + text

    def _until(self, part: str) -> str:
        return self.place[0][: self.place.start(part) - self.place.start()]


def results_of(text: str) -> Iterator[Result]:
    """What a page shows, in its order."""
    places = [place for kind in (_SHOWN, _BLOCK, _NAMED) for place in kind.finditer(text)]
    for place in sorted(places, key=lambda place: place.start()):
        yield Result(place, tuple(_numbers(place.groupdict().get("names") or "", place.groupdict().get("text") or "")))


def _numbers(names: str, text: str) -> Iterator[Number]:
    """Numbers that a comment names: one by one, or all in the last columns of a table."""
    for each in _NAME.finditer(names):
        if each["text"] != "rows":
            yield Number(**each.groupdict())
            continue
        table, _, columns = each["path"].partition(": ")
        wanted = columns.split(", ")
        for row in text.split("\n")[2:]:
            cells = [cell.strip(" `*") for cell in row.strip("|").split("|")]
            for column, cell in zip(wanted, cells[-len(wanted) :], strict=True):
                yield Number(cell, f"{table} > {cells[0]} > {column}", None, None)


def run(command: str) -> str:
    """What a command or a block prints, in an empty folder."""
    if command in COUNTED:
        return COUNTED[command].read_text(encoding="utf-8")
    output, said, code = io.StringIO(), io.StringIO(), 0
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.chdir(folder),
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(said),
    ):
        if command.startswith("chilopod "):
            code = main(shlex.split(command)[1:])
        else:
            exec(compile(command, "docs", "exec"), {})
    if code:
        raise RuntimeError(f"{command}: {said.getvalue()}")
    return output.getvalue()


def robots_of(command: str) -> dict[str, str]:
    """The presets that a command computes with, and a fingerprint of all their numbers."""
    words = set(re.split(r"[\s\"']", command))
    robots = [load_robot(name) for name in presets() if name in words or "reproduce" in words]
    return {robot.name: _fingerprint([(path, robot.get(path)) for path in robot.parameters()]) for robot in robots}


def renew(pages: Sequence[Path] = PAGES) -> None:
    """Run all that pages show, and write pages and results; what other pages show stays as it is."""
    others = [page.read_text(encoding="utf-8") for page in PAGES if page not in pages]
    elsewhere = {result.command for text in others for result in results_of(text)}
    before = json.loads(RESULTS.read_text(encoding="utf-8"))["commands"]
    kept: dict[str, dict[str, Any]] = {command: each for command, each in before.items() if command in elsewhere}
    printed: dict[str, str] = {}
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for result in reversed(list(results_of(text))):
            command = result.command
            if command not in printed:
                print(command, file=sys.stderr)
                begun = time.process_time()
                printed[command] = run(command)
                used = time.process_time() - begun
                kept.setdefault(command, {}).update(robots=robots_of(command), quick=used < QUICK)
            found = result.taken(printed[command])
            if result.numbers:
                kept[command]["values"] = kept[command].get("values", {}) | found
            else:
                kept[command]["output"] = found
            start, end = result.place.span()
            text = text[:start] + result.renewed(found) + text[end:]
        page.write_text(text, encoding="utf-8")
    said = {"chilopod": chilopod.__version__.partition("+")[0], "commands": dict(sorted(kept.items()))}
    RESULTS.write_text(json.dumps(said, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _without(printed: Sequence[str], like: Sequence[str]) -> list[str]:
    """Printed lines without those that the page leaves out."""
    dots = next((index for index, line in enumerate(like) if line.strip() == "..."), None)
    if dots is None:
        return list(printed)
    return [*printed[:dots], like[dots], *printed[len(printed) - (len(like) - dots - 1) :]]


def _at(table: Any, path: str) -> Any:
    for step in path.split(" > "):
        if isinstance(table, dict):
            table = table[step]
        elif step.lstrip("-").isdecimal():
            table = table[int(step)]
        else:
            table = next(row for row in table if step in row.values())
    return table


def _fingerprint(numbers: object) -> str:
    return hashlib.sha256(repr(numbers).encode()).hexdigest()[:16]


if __name__ == "__main__":
    renew([Path(each).resolve() for each in sys.argv[1:]] or PAGES)
