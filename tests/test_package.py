"""What is handed out: the distributions hold what they should, and the citation is one."""

import os
import runpy
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import yaml

import chilopod

ROOT = Path(__file__).parent.parent
RELEASE = chilopod.__version__.partition("+")[0]
BUILD = runpy.run_path(str(ROOT / "packaging" / "build.py"))
REQUIRED = {"software": {"authors", "cff-version", "message", "title"}, "article": {"authors", "title", "type"}}
"""Of the Citation File Format 1.2.0; a reference is of a type, the file itself need not say."""
ALLOWED = {
    "software": {*REQUIRED["software"], "abstract", "keywords", "license", "references", "type", "version"},
    "article": {*REQUIRED["article"], "journal", "year"},
}
"""Of what the format knows, what is used here."""
needs_git = pytest.mark.skipif(not shutil.which("git"), reason="no git")


@needs_git
@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no repository")
def test_distributions_hold_what_git_tracks_and_nothing_else(tmp_path):
    sdist, wheel = BUILD["build"](tmp_path)
    assert (sdist.name, wheel.name) == (f"chilopod-{RELEASE}.tar.gz", f"chilopod-{RELEASE}-py3-none-any.whl")
    assert BUILD["faults"](sdist, wheel) == []


@pytest.fixture
def checkout(tmp_path):
    """What a build takes, in a repository of its own; with what an earlier build left there."""
    root = tmp_path / "checkout"
    (root / "src").mkdir(parents=True)
    for name in ("LICENSE", "README.md", "pyproject.toml", "setup.py"):
        shutil.copy(ROOT / name, root)
    (root / "src" / "chilopod").mkdir()
    for name in ("__init__.py", "lazy.py", "sources.py"):
        shutil.copy(ROOT / "src" / "chilopod" / name, root / "src" / "chilopod")
    for left in ("chilopod/removed.py", "other/__init__.py"):
        (root / "build" / "lib" / left).parent.mkdir(parents=True, exist_ok=True)
        (root / "build" / "lib" / left).touch()
    (root / ".gitignore").write_text("build\n*.egg-info\n__pycache__\n")
    git(root, "init", "--quiet")
    git(root, "add", ".")
    git(root, "commit", "--quiet", "--message", "First")
    return root


def git(root, *words):
    who = ("-c", "user.name=nobody", "-c", "user.email=nobody@localhost", "-c", "commit.gpgsign=false")
    return subprocess.run(["git", "-C", root, *who, *words], capture_output=True, text=True, check=True).stdout.strip()


def version_of(package):
    """What the package in a folder says that it is, in a process of its own."""
    code = "import chilopod.sources; print(chilopod.__file__, chilopod.sources.checkout())"
    environment = {**os.environ, "PYTHONPATH": str(package), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    file, _, version = done.stdout.rstrip("\n").partition(" ")
    assert Path(file).is_relative_to(package)
    return version


@needs_git
def test_a_version_says_which_checkout_it_is(checkout):
    commit = "g" + git(checkout, "rev-parse", "--short=7", "HEAD")
    assert version_of(checkout / "src") == commit
    with (checkout / "README.md").open("a") as file:
        file.write("\n")
    assert version_of(checkout / "src") == f"{commit}.dirty"
    git(checkout, "commit", "--quiet", "--all", "--message", "Second")
    git(checkout, "tag", "v0.1.0")
    assert version_of(checkout / "src") == ""  # a release
    shutil.rmtree(checkout / ".git")
    assert version_of(checkout / "src") == ""  # of a source distribution


@needs_git
def test_a_wheel_of_a_checkout_holds_its_commit_and_nothing_of_an_earlier_build(checkout, tmp_path):
    commit = "g" + git(checkout, "rev-parse", "--short=7", "HEAD")
    wheel = BUILD["_built"]("wheel", checkout, tmp_path)
    installed = tmp_path / "installed"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(installed)
    assert version_of(installed) == commit
    names = {path.relative_to(installed).as_posix() for path in installed.rglob("*.py")}
    assert names == {"chilopod/__init__.py", "chilopod/lazy.py", "chilopod/sources.py"}


def test_the_citation_is_valid_and_of_this_version():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    (paper,) = cited["references"]
    for kind, entry in (("software", cited), ("article", paper)):
        assert REQUIRED[kind] <= set(entry) <= ALLOWED[kind]
        assert entry["type"] == kind
        assert all(set(each) in ({"name"}, {"given-names", "family-names", "affiliation"}) for each in entry["authors"])
    assert (cited["cff-version"], cited["version"], cited["license"]) == ("1.2.0", RELEASE, "Apache-2.0")
    assert paper["title"] == "Advanced turning maneuver of a many-legged robot using pitchfork bifurcation"
    assert len(paper["authors"]) == 8
