"""docs/new-section.md, followed to the letter."""

import json
import re
from pathlib import Path

import chilopod.paper
import chilopod.report.figures
from chilopod.cli import main, reproduce
from chilopod.paper import sections
from chilopod.report.figures import drawings

PAGE = (Path(__file__).parents[2] / "docs" / "new-section.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"```(?:python|text)\n(.*?)```", re.DOTALL)


def test_what_the_page_says_adds_a_section(monkeypatch, capsys, tmp_path):
    files = re.findall(r"`src/(chilopod/\S+\.py)`", PAGE)
    computed, *known, drawn, import_drawn, line = BLOCK.findall(PAGE)
    for name, code in zip(files, (computed, drawn), strict=True):
        path = tmp_path / name
        path.parent.mkdir(parents=True)
        path.write_text(code, encoding="utf-8")
    (tmp_path / "chilopod" / "paper" / "stride" / "__init__.py").write_text('"""The stride."""\n')
    for package in (chilopod.paper, chilopod.report.figures):
        where = tmp_path.joinpath(*package.__name__.split("."))
        monkeypatch.setattr(package, "__path__", [*package.__path__, str(where)])
    # The lines that make it known, at the end of the two registries.
    import_section, entry, listed = known
    names = vars(drawings).copy()
    exec(import_section + import_drawn, names)
    monkeypatch.setattr(sections, "SECTIONS", (*sections.SECTIONS, *eval(f"({entry})", names)))
    # That of the command lists the names, and its own test holds it to the sections.
    monkeypatch.setattr(reproduce, "_SECTIONS", (*reproduce._SECTIONS, *eval(f"({listed})")))
    assert set(reproduce._SECTIONS) == {each.name for each in sections.SECTIONS}
    monkeypatch.setattr(drawings, "DRAWINGS", (*drawings.DRAWINGS, *eval(f"({line})", names)))

    assert main(["reproduce", "--only", "stride", "--out", str(tmp_path / "report"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [(row["quantity"], row["verdict"]) for row in found["rows"]] == [
        ("critical k1 at 1.8 cm", "agrees"),
        ("critical k1 at 4 cm", "not printed"),
    ]
    page = (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
    assert "critical k₁ at 4\u00a0cm" in page
    assert '<section id="stride" class="figure">' in page
    for kept in ("figures/stride.png", "figures/stride.svg", "data/stride.csv", "data/stride.nc"):
        assert (tmp_path / "report" / kept).is_file()
