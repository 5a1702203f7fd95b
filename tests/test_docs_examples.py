"""The examples of docs/hybrid-systems.md print what they say."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parent.parent / "docs" / "hybrid-systems.md"
BLOCKS = [block for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S) if "#" in block]


def test_there_are_examples():
    assert len(BLOCKS) == 5


@pytest.mark.parametrize("block", BLOCKS)
def test_an_example(block, capsys):
    exec(compile(block, str(PAGE), "exec"), {"__name__": "example"})
    promised = [line[2:] for line in block.splitlines() if line.startswith("# ")]
    assert capsys.readouterr().out.splitlines() == promised
