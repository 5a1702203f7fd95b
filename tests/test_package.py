"""What is handed out: the distributions hold what they should, and the citation is one."""

import runpy
import shutil
from pathlib import Path

import pytest
import yaml

import chilopod

ROOT = Path(__file__).parent.parent
BUILD = runpy.run_path(str(ROOT / "packaging" / "build.py"))
REQUIRED = {
    "software": {"authors", "cff-version", "message", "title"},
    "article": {"authors", "title", "type"},
}
"""Of the Citation File Format 1.2.0; a reference is of a type, the file itself need not say."""
ALLOWED = {
    "software": {*REQUIRED["software"], "abstract", "keywords", "license", "references", "type", "version"},
    "article": {*REQUIRED["article"], "journal", "year"},
}
"""Of what the format knows, what is used here."""


@pytest.mark.skipif(not shutil.which("git") or not (ROOT / ".git").exists(), reason="no repository")
def test_distributions_hold_what_git_tracks_and_nothing_else(tmp_path):
    sdist, wheel = BUILD["build"](tmp_path)
    assert (sdist.name, wheel.name) == (
        f"chilopod-{chilopod.__version__}.tar.gz",
        f"chilopod-{chilopod.__version__}-py3-none-any.whl",
    )
    assert BUILD["faults"](sdist, wheel) == []


def test_the_citation_is_valid_and_of_this_version():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    (paper,) = cited["references"]
    for kind, entry in (("software", cited), ("article", paper)):
        assert REQUIRED[kind] <= set(entry) <= ALLOWED[kind]
        assert entry["type"] == kind
        assert all(set(each) in ({"name"}, {"given-names", "family-names", "affiliation"}) for each in entry["authors"])
    assert (cited["cff-version"], cited["version"], cited["license"]) == ("1.2.0", chilopod.__version__, "Apache-2.0")
    assert paper["title"] == "Advanced turning maneuver of a many-legged robot using pitchfork bifurcation"
    assert len(paper["authors"]) == 8
