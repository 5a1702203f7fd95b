"""What the documentation shows is run: every Python block that imports what it needs, with the output it claims."""

import contextlib
import io
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parent.parent / "docs"
BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)
PAGES = ["stability.md", "hybrid-systems.md"]


def blocks():
    for page in PAGES:
        for number, code in enumerate(BLOCK.findall((DOCS / page).read_text(encoding="utf-8"))):
            if "import" in code:  # others are fragments of text
                yield pytest.param(code, id=f"{page}-{number}")


@pytest.mark.parametrize("code", list(blocks()))
def test_a_block_prints_what_it_says(code):
    claimed = [line[2:] for line in code.splitlines() if line.startswith("# ")]
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(compile(code, "docs", "exec"), {})
    assert output.getvalue().splitlines() == claimed
