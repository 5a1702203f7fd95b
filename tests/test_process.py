"""Streams that may fail, and Ctrl-C, in the process of the command line."""

import errno
import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest

from chilopod import process
from chilopod.trials.claims import NAME


class LeftError(Exception):
    """Stands for the end of the process."""


@pytest.fixture
def answering(monkeypatch):
    """Ctrl-C answered as by the command line, but the process stays."""
    handlers, hook = [signal.getsignal(each) for each in process._ENDS], sys.unraisablehook
    signal.signal(signal.SIGINT, signal.default_int_handler)

    def leave(words=""):
        raise LeftError

    monkeypatch.setattr(process, "leave", leave)
    monkeypatch.setattr(process, "_pressed", [])
    monkeypatch.setattr(process.threading, "Thread", lambda **told: SimpleNamespace(start=lambda: None))
    process.answer_interrupts()
    yield
    os.close(signal.set_wakeup_fd(-1))
    for each, handler in zip(process._ENDS, handlers, strict=True):
        signal.signal(each, handler)
    sys.unraisablehook = hook


def test_ctrl_c_is_an_exception_once_and_then_the_end(answering):
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    with pytest.raises(LeftError):
        signal.raise_signal(signal.SIGINT)


def test_ctrl_c_ends_the_process_while_something_is_imported(answering, tmp_path, monkeypatch):
    (tmp_path / "interrupted_import.py").write_text("import signal\nsignal.raise_signal(signal.SIGINT)\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(LeftError):
        import interrupted_import  # noqa: F401


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="needs SIGHUP")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_all_that_ends_politely_leaves_nothing_behind(name, tmp_path):
    """Sent twice, as by a terminal that is closed; Ctrl-C once."""
    number = signal.Signals[name]
    times = 1 if name == "SIGINT" else 2
    script = f"""
import signal, tempfile, time
for each, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, 0), (signal.SIGHUP, 0)):
    signal.signal(each, usual)
from chilopod import process
process.answer_interrupts()
try:
    with tempfile.TemporaryDirectory(dir="."):
        try:
            signal.raise_signal({int(number)})
        finally:
            for _ in range({times - 1}):
                signal.raise_signal({int(number)})
except KeyboardInterrupt:
    raise SystemExit(process.exit_code())
"""
    ended = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (128 + number, "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGTERM")
def test_sigterm_ends_what_takes_long_to_stop():
    script = """
import signal, threading, time
from contextlib import suppress
from chilopod import process
process._PATIENCE = process._GRACE = 0.05
signal.signal(signal.SIGTERM, signal.SIG_DFL)
process.answer_interrupts()
threading.Thread(target=time.sleep, args=(30.0,)).start()
with suppress(KeyboardInterrupt):
    signal.raise_signal(signal.SIGTERM)
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=20.0)
    said = "stopping ... (Ctrl-C once more ends at once)\nerror: interrupted\n"
    assert (ended.returncode, ended.stderr) == (128 + signal.SIGTERM, said)


def test_an_end_on_the_spot_leaves_no_semaphores(tmp_path):
    (tmp_path / "interrupted_import.py").write_text("import signal\nsignal.raise_signal(signal.SIGINT)\n")
    script = """
import multiprocessing, signal
from chilopod.process import answer_interrupts
signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background of a script it is ignored
answer_interrupts()
lock = multiprocessing.get_context("spawn").Lock()
import interrupted_import
"""
    ended = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (process.INTERRUPTED, "", "error: interrupted\n")


def test_an_end_on_the_spot_leaves_no_claims_behind(tmp_path):
    (tmp_path / "interrupted_import.py").write_text("import signal\nsignal.raise_signal(signal.SIGINT)\n")
    script = """
import os, signal
from pathlib import Path
from chilopod.process import answer_interrupts
from chilopod.trials.store import Store
signal.signal(signal.SIGINT, signal.default_int_handler)
answer_interrupts()
with Store("kept").claims() as claims:
    print(os.listdir("kept"), flush=True)
    import interrupted_import
"""
    ended = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    claimed = f"{[NAME]}\n" if sys.platform == "linux" else "[]\n"
    assert (ended.returncode, ended.stdout, ended.stderr) == (process.INTERRUPTED, claimed, "error: interrupted\n")
    assert list((tmp_path / "kept").iterdir()) == []


def test_an_interrupt_that_nobody_can_raise_is_not_forgotten(answering):
    with pytest.raises(LeftError):
        sys.unraisablehook(SimpleNamespace(exc_type=KeyboardInterrupt))


def test_a_result_without_stdin_and_stdout_is_not_silently_lost():
    command = f"{sys.executable} -m chilopod --version <&- >&-"
    ended = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (2, "error: stdout cannot be written (Bad file descriptor)\n")


def test_what_cannot_be_written_is_lost_and_said_once():
    reading, writing = os.pipe()
    os.close(reading)
    with process.Stream(writing, "wb") as stream:
        assert stream.write(b"lost") == 4
        assert stream.failure.errno == errno.EPIPE
        assert process.unwritten(stream) is None  # whoever read it has seen enough
    with process.Stream(os.open(os.devnull, os.O_RDONLY), "wb") as closed:
        assert closed.write(b"lost") == 4
        assert process.unwritten(closed) == os.strerror(errno.EBADF)
