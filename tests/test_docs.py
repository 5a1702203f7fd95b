"""What README and docs show is what commands and blocks print."""

import contextlib
import io
import json
import re
import shlex
from decimal import Decimal
from pathlib import Path

import pytest
import renew
import typer
from PIL import Image

import chilopod
from chilopod.cli import app
from chilopod.robot import load_robot

ROOT = Path(__file__).resolve().parent.parent

FENCED = re.compile(
    r"^(?:<!-- (?P<why>not run: [^\n]+|run by make renew) -->\n)?```(?P<kind>\w+)\n(?P<code>.*?)^```$", re.M | re.S
)
COMMAND = re.compile(r"^(?:\$ )?(chilopod [^\n]*)$", re.MULTILINE)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
PAGES = {page.relative_to(ROOT).as_posix(): page.read_text(encoding="utf-8") for page in renew.PAGES}
SHOWN = [(name, result) for name, text in PAGES.items() for result in renew.results_of(text)]
KEPT = json.loads(renew.RESULTS.read_text(encoding="utf-8"))
OUT_OF_DATE = "run `make renew`, and look at what it changes"


def kept_of(result):
    return KEPT["commands"][result.command]["values" if result.numbers else "output"]


def test_results_are_of_these_robots_and_this_version():
    assert set(KEPT["commands"]) == {result.command for _, result in SHOWN}, OUT_OF_DATE
    assert KEPT["chilopod"] == chilopod.__version__.partition("+")[0], OUT_OF_DATE
    for command, kept in KEPT["commands"].items():
        assert kept["robots"] == renew.robots_of(command), f"{command}: another robot; {OUT_OF_DATE}"


@pytest.mark.parametrize(("page", "result"), SHOWN, ids=[f"{page}-{each.command[:40]}" for page, each in SHOWN])
def test_pages_show_what_was_computed(page, result):
    assert result.renewed(kept_of(result)) == result.place[0], OUT_OF_DATE


@pytest.mark.parametrize("command", sorted(each for each, kept in KEPT["commands"].items() if kept["quick"]))
def test_quick_commands_print_it_still(command):
    """To one unit of the last digit: processors round differently."""
    printed = renew.run(command)
    for result in [each for _, each in SHOWN if each.command == command]:
        here, kept = result.renewed(result.taken(printed)), result.renewed(kept_of(result))
        assert NUMBER.sub("#", here) == NUMBER.sub("#", kept)
        for one, other in zip(NUMBER.findall(here), NUMBER.findall(kept), strict=True):
            assert abs(Decimal(one) - Decimal(other)) <= Decimal(1).scaleb(Decimal(other).as_tuple().exponent)


@pytest.mark.parametrize("page", PAGES)
def test_nothing_is_shown_unchecked(page):
    """Every prompt begins a block of its own, every block of Python is run or says why not."""
    shown = [result.place[0] for name, result in SHOWN if name == page and not result.numbers]
    blocks = [block for block in FENCED.finditer(PAGES[page]) if re.search(r"^\$ ", block["code"], re.MULTILINE)]
    assert [block["code"] for block in blocks] == [block[6:-3] for block in shown if block.startswith("```sh")]
    assert PAGES[page].count("<!-- ") == len([each for name, each in SHOWN if name == page and each.numbers]) + len(
        re.findall(r"^<!-- (?:run by make renew|not (?:run|renewed): [^\n]+) -->$", PAGES[page], re.MULTILINE)
    )


def test_another_robot_or_number_is_noticed(monkeypatch):
    command = "chilopod stability aoi2022-planar"
    stated = renew.robots_of(command)
    assert list(stated) == ["aoi2022-planar"]
    slippery = load_robot("aoi2022-planar").with_value("ground.friction", 200.0)
    monkeypatch.setattr(renew, "load_robot", lambda name: slippery)
    assert renew.robots_of(command) != stated

    names = "     1.50 = a > row > b * 10\n     7 = a > 0 > c ~ of (\\d+)"
    page = f"<!-- chilopod x --json\n{names} -->\nIt is 1.50, of 7."
    (result,) = renew.results_of(page)
    values = result.taken('{"a": [{"name": "row", "b": 0.15, "c": "3 of 7"}]}')
    assert result.renewed(values) == page
    changed = result.renewed({"a > row > b": 0.16, "a > 0 > c": "3 of 8"})
    assert changed.endswith("It is 1.60, of 8.")
    (again,) = renew.results_of(changed)
    assert [number.text for number in again.numbers] == ["1.60", "8"]
    with pytest.raises(ValueError, match=r"does not have 1\.50"):
        next(renew.results_of(page.replace("It is 1.50", "It is 1.51"))).renewed(values)


# docs/new-section.md is followed by a test of its own.
@pytest.mark.parametrize("page", [name for name in PAGES if name != "docs/new-section.md"])
def test_python_blocks_print_what_they_say(page, tmp_path, monkeypatch):
    """Each as a file of its own. A block that is not run says why in a comment before it."""
    monkeypatch.chdir(tmp_path)
    for block in FENCED.finditer(PAGES[page]):
        if block["kind"] == "python" and not block["why"]:
            claimed = [line[2:] for line in block["code"].splitlines() if line.startswith("# ")]
            output = io.StringIO()
            with contextlib.redirect_stdout(output):
                exec(compile(block["code"], page, "exec"), {"__name__": "__main__"})
            if claimed:
                assert output.getvalue().splitlines() == claimed


def test_the_moving_picture_moves_and_is_small():
    file = ROOT / "docs" / "images" / "turning.webp"
    assert file.relative_to(ROOT).as_posix() in PAGES["README.md"]
    assert file.stat().st_size < 1_500_000
    with Image.open(file) as picture:
        assert picture.n_frames > 50


def test_commands_parse():
    """Those without output too: what they name is there."""
    lines = [(page, line) for page, text in PAGES.items() for line in COMMAND.findall(text)]
    assert len(lines) > 20
    for page, line in lines:
        parsed(page, line)


def parsed(page, line):
    command, words = typer.main.get_command(app), shlex.split(line, comments=True)[1:]
    while hasattr(command, "commands") and words and words[0] in command.commands:
        command = command.commands[words.pop(0)]
    command.make_context(f"{page}: {line}", words)
    return command


def test_every_command_has_an_example():
    pending = [typer.main.get_command(app)]
    while pending:
        command = pending.pop()
        pending += getattr(command, "commands", {}).values()
        if not hasattr(command, "commands"):
            shown = command.get_help(typer.Context(command)).partition("\n  Example:\n    ")[2]
            assert "\n" not in shown.strip()
            assert parsed("--help", shown).help == command.help


def test_every_command_is_in_the_table():
    table = re.findall(r"^\| `([^|]*)` \|", PAGES["docs/command-line.md"], re.MULTILINE)
    listed = {name.partition(" ")[0] for name in table}
    assert listed == set(typer.main.get_command(app).commands)


# What users write, and what commands write.
MADE = re.compile(
    r"^(my|mine|steer|mymodule|identified|identification|sized)\.|NAME|^(report|build|turn|course)/|^(course|walk|play|play-page)\.html$|(paper|figures)/stride"
)


def test_every_file_that_a_page_names_is_there():
    there = {each.as_posix() for each in ROOT.rglob("*.*") if ".venv" not in each.parts}
    for page, text in PAGES.items():
        for name in re.findall(r"(?<![\w:/])[\w./-]+\.(?:py|md|js|toml|json|html|css|lock)\b", text):
            plain = name.removeprefix("../").removeprefix("../").removeprefix("./")
            assert MADE.search(plain) or any(each.endswith(f"/{plain}") for each in there), f"{page}: {name}"


@pytest.mark.parametrize("role", ["dotted", "relative"])
def test_every_module_that_the_code_names_is_there(role):
    """Imports are checked elsewhere; these are names in docstrings and comments."""
    source = ROOT / "src"
    for file in source.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        if role == "relative":
            for name in re.findall(r":mod:`\.([\w.]+)`", text):
                assert file.with_name(f"{name}.py").exists(), f"{file}: .{name}"
            continue
        for name in re.findall(r"\bchilopod(?:\.\w+)+", text):
            place, *parts = source / "chilopod", *name.split(".")[1:]
            while parts and (place / parts[0]).is_dir():
                place /= parts.pop(0)
            # Of a package that loads what it exports on first use any name may be an export: it says which.
            init = (place / "__init__.py").read_text(encoding="utf-8")
            known = not parts or (place / f"{parts[0]}.py").exists() or re.search(rf"\b{parts[0]}\b", init)
            assert known, f"{file}: {name}"
