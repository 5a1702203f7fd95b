"""docs/new-section.md, followed to the letter."""

import re
from pathlib import Path

import chilopod.paper
from chilopod.paper import registry
from helpers.command_line import printed

PAGE = (Path(__file__).parents[3] / "docs" / "new-section.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"```(?:python|text)\n(.*?)```", re.DOTALL)


def test_what_the_page_says_adds_a_section(monkeypatch, tmp_path):
    files = re.findall(r"`src/(chilopod/\S+\.py)`", PAGE)
    computed, drawn, line = BLOCK.findall(PAGE)
    for name, code in zip(files, (computed, drawn), strict=True):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(code, encoding="utf-8")
    (tmp_path / "chilopod" / "paper" / "stride" / "__init__.py").write_text('"""The stride."""\n')
    monkeypatch.setattr(chilopod.paper, "__path__", [*chilopod.paper.__path__, str(tmp_path / "chilopod" / "paper")])
    monkeypatch.setattr(registry, "REGISTRY", {**registry.REGISTRY, **eval(f"{{{line}}}")})

    found = printed("reproduce", "--only", "stride", "--out", tmp_path / "report", "--json")
    assert [(row["quantity"], row["verdict"]) for row in found["rows"]] == [
        ("critical k1 at 1.8 cm", "agrees"),
        ("critical k1 at 4 cm", "not printed"),
    ]
    page = (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
    assert "critical k₁ at 4\u00a0cm" in page
    assert '<section id="stride" class="figure"' in page
    for kept in ("figures/stride.png", "figures/stride.svg", "data/stride.csv", "data/stride.nc"):
        assert (tmp_path / "report" / kept).is_file()
