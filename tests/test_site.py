"""Pages lead somewhere, and what the site generates leaves nothing out. The site itself is built by `make docs`."""

import re
from pathlib import Path

import check
import conf
import extension
import pytest
import reference
import typer

from chilopod.cli import app
from chilopod.robot.parameters import QUANTITIES

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("page", check.PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_of_pages_lead_somewhere(page):
    assert list(check.broken_links(page)) == []


def test_broken_links_are_found(tmp_path):
    (tmp_path / "other.md").write_text("# One `thing`, and two\n\n```\n# no heading\n```\n")
    page = tmp_path / "page.md"
    page.write_text(
        "[a](other.md#one-thing-and-two) [b](#c) [d](gone.md) [e](other.md#no-heading) [f](https://f.org)\n"
    )
    assert [line.rpartition(": ")[0].rpartition(" ")[2] for line in check.broken_links(page)] == [
        "#c",
        "gone.md",
        "other.md#no-heading",
    ]


def test_a_site_that_loads_from_outside_or_leads_nowhere_is_found(tmp_path):
    (tmp_path / "style.css").write_text("@import url(https://fonts.org/a.css);")
    (tmp_path / "index.html").write_text(
        '<p id="here"><a href="https://fine.org"></a><a href="#here"></a><a href="#there"></a><a href="b.html"></a>'
        '<script src="https://cdn.org/a.js"></script><iframe srcdoc="&lt;img src=&quot;http://a.org/b.png&quot;>">'
    )
    assert [line.partition(": ")[2] for line in check.faults(tmp_path)] == [
        "#there: no such place",
        "b.html: no such file",
        "loads https://cdn.org/a.js",
        "loads http://a.org/b.png",
        "loads something",
    ]


def test_every_command_and_option_is_in_the_reference():
    page = reference.commands_page()
    pending = [("chilopod", typer.main.get_command(app))]
    while pending:
        words, command = pending.pop()
        pending += [(f"{words} {name}", inner) for name, inner in getattr(command, "commands", {}).items()]
        own = page.partition(f".. program:: {words}\n")[2].partition(".. program::")[0]
        for parameter in [each for each in command.params if not getattr(each, "hidden", False)]:
            shown = parameter.metavar if parameter.param_type_name == "argument" else parameter.opts[0]
            assert f".. option:: {shown}" in own, (words, shown)


def test_every_number_of_a_robot_is_in_the_reference():
    page = reference.robot_keys_page()
    assert [path for path in QUANTITIES if f".. robotkey:: {path}\n\n   " not in page] == []
    gait = page.partition(".. robotkey:: gait.stride\n")[2].partition("..")[0]
    assert "Distance from AEP to PEP, m." in gait
    assert "3 cm (paper, section Robot: distance between AEP and PEP)" in gait


def test_the_python_reference_describes_each_export_once(monkeypatch):
    some = ["chilopod", "chilopod.robot", "chilopod.stability"]
    monkeypatch.setattr(reference, "packages", lambda: some)
    monkeypatch.setattr(reference, "homes", reference.homes.__wrapped__)
    pages = "".join(map(reference.api_page, some))
    described = re.findall(r"^\.\. (?:auto(?:class|exception|function)|data):: (\w+)$", pages, re.MULTILINE)
    assert sorted(described) == sorted({name for package in some for name in reference.exports(package)})
    assert reference.public_name("chilopod.robot.model.load_robot") == "chilopod.robot.load_robot"
    assert reference.public_name("chilopod.robot.inertia") == "chilopod.robot.inertia"
    assert reference.public_name("chilopod.robot.nothing") is None


def test_every_page_is_in_the_table_of_contents():
    index = ROOT / f"{conf.root_doc}.md"
    listed = re.findall(
        r"^[\w./-]+$", "".join(re.findall(r"^```{toctree}(.*?)^```", index.read_text(), re.M | re.S)), re.M
    )
    found = {(index.parent / f"{name}.md").resolve() for name in listed}
    assert {page for page in check.PAGES if page.name != "README.md" or page.parent.name == "benchmarks"} <= found | {
        index
    }


def test_what_stands_in_docstrings_is_no_markup():
    lines = ["Of ``*a`` and |theta|, (x, *args).", "", "Attributes", "----------", "stance, swing", "    Of both, s."]
    extension.docstring(None, "class", "x", None, None, lines)
    assert lines[0] == r"Of ``*a`` and \|theta\|, (x, \*args)."
    assert lines[4:] == ["stance", "    Of both, s.", "swing", "    Of both, s."]
    types = "~collections.abc.Mapping[str, ~numpy.typing.Any | chilopod.robot.Robot]"
    assert extension.without_modules(types) == "Mapping[str, Any | chilopod.robot.Robot]"
