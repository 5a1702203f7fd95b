"""What an extra brings and is not there is one line, with the extra's name."""

import re
import sys
import tomllib
from pathlib import Path

import pytest

from chilopod.errors import ChilopodError
from chilopod.extras import needs

ROOT = Path(__file__).parent.parent
NEEDED = re.compile(r'\bneeds\("(\w+)", extra="(\w+)"\)')


def test_what_is_there_is_passed_over():
    needs("json", extra="live")


def test_what_is_absent_is_one_line_with_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(ImportError) as caught:
        needs("viser", extra="live")
    assert isinstance(caught.value, ChilopodError)
    assert str(caught.value) == 'viser is not installed; to mend it: pip install "chilopod[live]"'


def test_what_lacks_a_part_of_its_own_says_which(tmp_path, monkeypatch):
    (tmp_path / "half_installed.py").write_text("import no_such_part\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ImportError, match=r"half_installed cannot be imported: .*'no_such_part'; .*chilopod\[live\]"):
        needs("half_installed", extra="live")


def test_extras_bring_what_is_needed_of_them():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    sources = (ROOT / "src" / "chilopod").rglob("*.py")
    needed = {found for source in sources for found in NEEDED.findall(source.read_text(encoding="utf-8"))}
    assert ("distributed", "cluster") in needed
    for package, extra in needed:
        assert package in [re.match(r"[\w-]+", each)[0].replace("-", "_") for each in extras[extra]]
