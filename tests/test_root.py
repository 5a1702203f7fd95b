"""The root of the repository stays as it is whatever the documentation's commands, run there, write."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import typer

from chilopod.cli import app

ROOT = Path(__file__).parent.parent
COMMANDS = re.compile(r"^(?:\$ )?chilopod (.*)$", re.MULTILINE)
WRITTEN = re.compile(r"--(?:out|trials|resume) (\S+)|robot new (\S+)")


def written() -> set[str]:
    """What commands of README and docs write into the present folder, and what commands write there by default."""
    found = set()
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        for line in COMMANDS.findall(page.read_text(encoding="utf-8")):
            found |= {one or other for one, other in WRITTEN.findall(line)}
    for name in ("reproduce", "identify planar", "identify twin"):
        command = typer.main.get_command(app)
        for part in name.split():
            command = command.commands[part]
        found |= {str(each.default) for each in command.params if each.name == "out"}
    return found


@pytest.mark.skipif(not shutil.which("git") or not (ROOT / ".git").exists(), reason="no repository")
def test_git_ignores_what_commands_write():
    paths = sorted(path if Path(path).suffix else f"{path}/x" for path in written())
    assert {"report/x", "identification/x", "identification-twin/x", "my.toml", "walks.nc", "turn/x"} <= set(paths)
    checked = subprocess.run(
        ["git", "-C", str(ROOT), "check-ignore", "--no-index", *paths], capture_output=True, text=True, check=False
    )
    assert set(paths) - set(checked.stdout.split()) == set()


def test_glossary_links_lead_somewhere():
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    links = re.findall(r"\]\(([\w-]+\.md)\)", text)
    assert links
    assert all((ROOT / "docs" / link).exists() for link in links)
