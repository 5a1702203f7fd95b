"""Compiled code: kept wherever it can be, never older than the sources, and never another function's."""

import json
import os
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

import chilopod
from chilopod import numba_internals

PACKAGE = Path(chilopod.__file__).parent
NEEDED = ("__init__.py", "compiled.py", "errors.py", "lazy.py", "numba_internals.py", "sources.py")
CALLEE = "from chilopod.compiled import njit\n\n@njit\ndef inner(x):\n    return 3.0 * x\n"
CALLER = "from chilopod.compiled import njit\nfrom chilopod.deep.callee import inner\n\n" + (
    "@njit\ndef outer(x):\n    return inner(x) + 1.0\n"
)
# One process that has imported numba and compiled something; every run is a child of it.
RUNS = """
import json, os, sys, traceback, warnings
import numba

numba.njit(lambda x: x)(1.0)

def edit(path, old, new):
    state = os.stat(path)
    with open(path) as file:
        text = file.read()
    assert old in text
    with open(path, "w") as file:
        file.write(text.replace(old, new))
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))

def run(site, environment, edits=None):
    sys.path.insert(0, site)
    os.environ.update(environment)
    numba.config.reload_config()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        from chilopod.caller import outer
        if edits:
            edit(*edits)
        value = outer(1.0)
    said = [str(each.message) for each in caught]
    return value, sum(outer.stats.cache_hits.values()), outer.stats.cache_path, said

for line in sys.stdin:
    if not (child := os.fork()):
        try:
            print(json.dumps(run(*json.loads(line))), flush=True)
        except BaseException:
            print(json.dumps(traceback.format_exc()), flush=True)
        os._exit(0)
    os.waitpid(child, 0)
"""
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="runs are forked")


@contextmanager
def started(**environment):
    kept = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    with subprocess.Popen(
        [sys.executable, "-c", RUNS],
        # Bytecode of Python would not see a change of equal size and time.
        env={**kept, "PYTHONDONTWRITEBYTECODE": "1", **environment},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        yield process
        process.stdin.close()


@pytest.fixture(scope="module")
def runner():
    with started() as process:
        yield process


class Package:
    """A package of this name in which one compiled function calls that of another file."""

    def __init__(self, runner, folder):
        self.runner = runner
        self.user = {"XDG_CACHE_HOME": str(folder / "user"), "HOME": str(folder / "user")}
        self.path = folder / "site" / "chilopod"
        (self.path / "deep").mkdir(parents=True)
        for name in NEEDED:
            shutil.copy(PACKAGE / name, self.path)
        (self.path / "deep" / "__init__.py").touch()
        self.caller = self.path / "caller.py"
        self.callee = self.path / "deep" / "callee.py"
        self.caller.write_text(CALLER)
        self.callee.write_text(CALLEE)

    def run(self, edit=None, **environment):
        """What the function returns, how often its code was found, where it is kept, and what was said."""
        words = [str(self.path.parent), {**self.user, **environment}, edit and [str(edit[0]), *edit[1:]]]
        self.runner.stdin.write(json.dumps(words) + "\n")
        self.runner.stdin.flush()
        answer = json.loads(self.runner.stdout.readline())
        assert isinstance(answer, list), answer
        return answer

    def change(self, old, new):
        """Edit the callee; neither its size nor its time of change say so."""
        state = self.callee.stat()
        self.callee.write_text(CALLEE.replace(old, new))
        os.utime(self.callee, ns=(state.st_atime_ns, state.st_mtime_ns))

    def close(self):
        """Nobody may write compiled code into it: not even root, for whom permissions do not count."""
        for folder in (self.path, self.path / "deep"):
            (folder / "__pycache__").touch()


@pytest.fixture
def package(runner, tmp_path):
    return Package(runner, tmp_path)


@pytest.mark.parametrize("place", ["beside the sources", "chosen", "the user's"])
def test_changed_sources_never_run_old_code(package, tmp_path, place):
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / "chosen")} if place == "chosen" else {}
    if place == "the user's":
        package.close()
    found = [package.run(**environment), package.run(**environment)]
    package.change("3.0", "5.0")
    found += [package.run(**environment), package.run(**environment)]
    package.change("5.0", "3.0")
    found += [package.run(**environment)]
    assert [(value, hits) for value, hits, *_ in found] == [(4.0, 0), (4.0, 1), (6.0, 0), (6.0, 1), (4.0, 1)]
    root = {"beside the sources": package.path / "__pycache__", "the user's": tmp_path / "user"}
    root = root.get(place, tmp_path / "chosen")
    assert all(Path(folder).is_relative_to(root) and not said for *_, folder, said in found)
    assert found[0][2] == found[4][2] != found[2][2]


def test_code_of_few_versions_is_kept(package):
    for factor in range(3, 8):
        package.change("3.0", f"{factor}.0")
        assert package.run()[0] == factor + 1.0
    assert len([*package.path.glob("__pycache__/chilopod-*")]) == numba_internals.FOLDERS


def test_without_any_place_it_compiles_and_says_so_once(package):
    package.close()
    nowhere = {"XDG_CACHE_HOME": os.devnull, "HOME": os.devnull}
    for _ in range(2):
        value, hits, folder, (line,) = package.run(**nowhere)
        assert (value, hits, folder) == (4.0, 0, None)
        assert "NUMBA_CACHE_DIR" in line
        assert "\n" not in line


def test_sources_edited_while_a_process_runs(package):
    # What it has imported and what it imports later would be of two versions: it neither keeps nor takes.
    found = [package.run(edit=(package.caller, "1.0", "2.0")), package.run()]
    found += [package.run(edit=(package.callee, "3.0", "5.0")), package.run()]
    assert [(value, hits) for value, hits, *_ in found] == [(4.0, 0), (5.0, 0), (5.0, 0), (7.0, 0)]


def test_damaged_code_is_compiled_anew(package):
    _, _, folder, _ = package.run()
    for damaged in (".nbi", ".nbc"):
        for path in Path(folder).glob(f"caller.outer*{damaged}"):
            path.write_bytes(b"nothing")
        assert [package.run()[:2] for _ in range(2)] == [[4.0, 0], [4.0, 1]]


def test_processors_share_a_folder(package):
    native = package.runner
    found = [package.run()]
    with started(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="") as package.runner:
        found += [package.run(), package.run()]
    package.runner = native
    found += [package.run()]
    assert [(value, hits) for value, hits, *_ in found] == [(4.0, 0), (4.0, 0), (4.0, 1), (4.0, 1)]
    assert len({folder for *_, folder, _ in found}) == 1


def test_two_processes_that_keep_at_once(tmp_path, monkeypatch):
    # Both read the index before either writes: an entry may be lost, but it never stands for the other's code.
    first, second = (numba_internals._File(str(tmp_path), "caller", "stamp") for _ in range(2))
    with monkeypatch.context() as patched:
        patched.setattr(numba_internals._File, "_load_index", lambda self: {})
        first.save("float64", "of float64")
        second.save("int64", "of int64")
    assert first.load("float64") in (None, "of float64")
    assert first.load("int64") == "of int64"
    assert len([*tmp_path.glob("*.nbc")]) == 2
