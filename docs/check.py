"""What is checked of pages and of the built site: every link leads somewhere, nothing is loaded from outside.

``python docs/check.py build/site`` checks a site, and says how large it is and which examples took long. What checks
the pages as they stand is run by the tests.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

ROOT = Path(__file__).resolve().parent.parent
PAGES = (*ROOT.glob("*.md"), *sorted((ROOT / "docs").rglob("*.md")), ROOT / "benchmarks" / "README.md")
LONG = 20.0
"""What an example may take, s."""

_FENCED = re.compile(r"^(```|~~~).*?^\1\s*$|^    .*$|<!--.*?-->|`[^`\n]*`", re.M | re.S)
_LINK = re.compile(r"\]\((?!https?:|mailto:)([^)\s]+)\)")
_HEADING = re.compile(r"^#+ +(.*?) *$", re.MULTILINE)
_FENCE = re.compile(r"^(```|~~~).*?^\1\s*$", re.M | re.S)
_LOADED = re.compile(r"""url\(\s*['"]?(?:https?:)?//|@import""")
_LOADS = {
    ("img", "src"),
    ("script", "src"),
    ("link", "href"),
    ("iframe", "src"),
    ("source", "src"),
    ("video", "src"),
    ("video", "poster"),
    ("audio", "src"),
    ("object", "data"),
    ("embed", "src"),
    ("use", "href"),
}


def broken_links(page: Path) -> Iterator[str]:
    """Links of a Markdown page that lead to no file or to no heading, as GitHub names headings."""
    for link in _LINK.findall(_FENCED.sub("", page.read_text(encoding="utf-8"))):
        place, _, anchor = unquote(link).partition("#")
        target = (page.parent / place).resolve() if place else page
        if not target.exists():
            yield f"{page}: {link}: no such file"
        elif anchor and anchor not in headings(target):
            yield f"{page}: {link}: no such heading"


@cache
def headings(page: Path) -> frozenset[str]:
    """Anchors of the headings of a Markdown page."""
    found: list[str] = []
    for heading in _HEADING.findall(_FENCE.sub("", page.read_text(encoding="utf-8"))):
        text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower()
        slug = re.sub(r"[^\w\- ]", "", text).replace(" ", "-")
        found.append(f"{slug}-{found.count(slug)}" if slug in found else slug)
    return frozenset(found)


class _Page(HTMLParser):
    """Anchors of an HTML page, where it leads, and what it loads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.leads: list[str] = []
        self.loads: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        told = {name: value for name, value in attrs if value is not None}
        self.anchors |= {told[name] for name in ("id", "name") if name in told}
        if tag == "a" and "href" in told:
            self.leads.append(told["href"])
        self.loads += [value for name, value in told.items() if (tag, name) in _LOADS]
        self.loads += [each.split()[0] for each in told.get("srcset", "").split(",") if each]
        if "srcdoc" in told:
            self.loads += _Page(told["srcdoc"]).loads


def faults(site: Path) -> Iterator[str]:
    """Links of the built site that lead nowhere, and what would be loaded from outside."""
    pages = {path: _Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    for path, page in pages.items():
        for link in page.leads + page.loads:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                if link in page.loads and parts.scheme != "data":
                    yield f"{path}: loads {link}"
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                yield f"{path}: {link}: no such file"
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
                yield f"{path}: {link}: no such place"
    for path in sorted(site.rglob("*.css")):
        if _LOADED.search(path.read_text(encoding="utf-8")):
            yield f"{path}: loads something"


def main(site: Path) -> int:
    """Check a built site; 1 where something is wrong."""
    wrong = [*faults(site.resolve()), *(fault for page in PAGES for fault in broken_links(page))]
    print(*wrong, sep="\n", end="\n" if wrong else "")
    for path in sorted((ROOT / "docs" / "gallery").rglob("*.cost.json")):
        taken = json.loads(path.read_text(encoding="utf-8"))["time"]
        if taken > LONG:
            print(f"{path.name.partition('.')[0]} took {taken:.0f} s; once all is compiled an example has {LONG:.0f} s")
    files = [path for path in site.rglob("*") if path.is_file()]
    pages = sum(path.suffix == ".html" for path in files)
    size = sum(path.stat().st_size for path in files) / 1e6
    print(f"{site}: {pages} pages, {len(files)} files, {size:.1f} MB; {len(wrong)} faults")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
