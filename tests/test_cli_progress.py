"""Progress on stderr: nothing of what is quick, a sign of life of all else."""

import logging
import time
from types import SimpleNamespace

import numba
import pytest

from chilopod import numba_internals
from chilopod.cli import progress


@pytest.fixture
def hasty(monkeypatch):
    """Seconds are hundredths."""
    for name in ("_UNTIL_BAR", "_BETWEEN_LOOKS", "_UNTIL_LINE", "_BETWEEN_LINES"):
        monkeypatch.setattr(progress, name, 0.01 * getattr(progress, name))


def test_what_is_quick_says_nothing(capsys):
    with progress.progress_bar("work") as show:
        show("work", 0.5, "half")
    assert capsys.readouterr().err == ""


def test_lines_go_on_where_nothing_is_told(capsys, hasty):
    with progress.progress_bar("work") as show:
        time.sleep(0.1)
        show("part", 0.5, "half")
        time.sleep(0.15)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("work: ")
    assert lines[-1].startswith("part:  50 %  half, ")
    assert len(lines) >= 3


def test_a_terminal_gets_bars(capsys, hasty, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    with progress.progress_bar("work") as show:
        time.sleep(0.1)
        show("part", 0.5, "half")
        time.sleep(0.05)
        show("part", 1.0, "all of it")
    assert "all of it" in capsys.readouterr().err


def test_every_wait_for_the_compiler_is_said_without_a_command_line(caplog, monkeypatch):
    monkeypatch.setattr(logging.getLogger("chilopod"), "disabled", False)
    listener = numba_internals._Compiling()
    monkeypatch.setattr(numba_internals, "NOTICED", 0.0)
    made = [SimpleNamespace(__module__=name) for name in ("chilopod.x", "mine")]
    own, other = (SimpleNamespace(data={"dispatcher": each}) for each in made)
    for each in (own, other, own, own):  # so far nothing has been compiled when the first begins
        listener.on_start(each)
        listener.on_end(each)
    said = "chilopod: compiling, once on this machine"
    assert [each.message for each in caplog.records] == [said]
    monkeypatch.setattr(numba_internals, "_APART", 0.0)
    for each in (own, own):  # another kind of system, which calls a function
        listener.on_start(each)
    assert [each.message for each in caplog.records] == [said, said]
    monkeypatch.setattr(numba_internals, "_AGAIN", 0.0)
    for _ in range(2):  # it goes on
        listener._due -= 15.0
        listener.on_start(own)
    assert [each.message for each in caplog.records] == [said] * 4


def test_compiling_is_said_once(capsys, hasty, monkeypatch):
    before = numba_internals.COMPILING.seconds()
    numba.njit(lambda x: x + before)(1.0)  # nothing that is kept
    spent = numba_internals.COMPILING.seconds() - before
    assert spent > 0.0
    assert numba_internals.COMPILING.seconds() == before + spent  # it is over
    monkeypatch.setattr(numba_internals, "NOTICED", 0.5 * spent)
    with progress.progress_bar("work"):
        time.sleep(0.2)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "work: compiling, once on this machine"
    assert len(lines) > 2
    assert not any("compiling" in line for line in lines[1:])
    monkeypatch.setattr(numba_internals, "NOTICED", 1e9)
    with progress.progress_bar("work"):
        time.sleep(0.1)
    assert "compiling" not in capsys.readouterr().err


def test_a_module_that_is_being_loaded_compiles_nothing(monkeypatch):
    monkeypatch.setitem(progress.sys.modules, "chilopod.numba_internals", SimpleNamespace(NOTICED=1.0))
    assert not progress._compiling()
