"""Finding an OpenGL backend: whatever a driver does, the process that asks goes on and gets one line to act on."""

import importlib.util
import os
import subprocess
import sys

import pytest

from chilopod.errors import OutputError
from chilopod.twin import gl


@pytest.fixture(autouse=True)
def afresh(monkeypatch):
    for name in ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    gl.find.cache_clear()
    yield
    gl.find.cache_clear()


def answers(monkeypatch, **faults):
    """Let backends have these faults, empty for none; returns what is tried."""
    tried = []

    def trial(name):
        tried.append(name)
        return ("a driver", "") if not faults[name] else ("", faults[name])

    monkeypatch.setattr(gl, "_tried", trial)
    return tried


def test_takes_the_first_that_works_and_remembers_it(monkeypatch):
    tried = answers(monkeypatch, egl="crashes", osmesa="")
    assert gl.find() == gl.Found("osmesa", "a driver")
    assert gl.find().backend == "osmesa"
    assert tried == ["egl", "osmesa"]


def test_tries_glfw_only_with_a_display(monkeypatch):
    tried = answers(monkeypatch, egl="broken", osmesa="broken", glfw="")
    assert gl.find().backend is None
    assert tried == ["egl", "osmesa"]
    gl.find.cache_clear()
    monkeypatch.setenv("DISPLAY", ":0")
    assert gl.find().backend == "glfw"


@pytest.mark.parametrize(("system", "first"), [("darwin", "cgl"), ("win32", "glfw")])
def test_other_systems_have_their_own(monkeypatch, system, first):
    monkeypatch.setattr(sys, "platform", system)
    answers(monkeypatch, **{first: ""})
    assert gl.find().backend == first


@pytest.mark.parametrize(("wish", "name"), [("egl", "egl"), (" OSMesa ", "osmesa"), ("glx", "glfw"), ("on", "egl")])
def test_what_the_user_set_counts(monkeypatch, wish, name):
    monkeypatch.setenv("MUJOCO_GL", wish)
    tried = answers(monkeypatch, egl="", osmesa="", glfw="")
    assert gl.find().backend == name
    assert tried == [name]


@pytest.mark.parametrize(("wish", "says"), [("off", "switched off"), ("cgl", "no backend"), ("egl", "egl: broken")])
def test_what_the_user_set_and_does_not_work(monkeypatch, wish, says):
    monkeypatch.setenv("MUJOCO_GL", wish)
    answers(monkeypatch, egl="broken", osmesa="", glfw="")
    found = gl.find()
    assert found.backend is None
    assert says in found.missing
    assert found.mend == "unset MUJOCO_GL"


def test_says_in_one_line_what_mends_it(monkeypatch):
    answers(monkeypatch, egl="its library is not installed", osmesa="No module named 'OpenGL'")
    with pytest.raises(OutputError, match="pip install") as caught, gl.context(8, 8):
        pass
    assert str(caught.value).isprintable()
    gl.find.cache_clear()
    answers(monkeypatch, egl="its library is not installed", osmesa="its library is not installed")
    with pytest.raises(OutputError, match="apt install libegl1"), gl.context(8, 8):
        pass


@pytest.mark.parametrize(
    ("code", "says"),
    [
        ("import os; os.abort()", "crashes"),
        ("import time; time.sleep(60)", "gave no answer"),
        ("raise SystemExit(3)", "exit code 3"),
        ("None.glGetError", "library is not installed"),
        ("import no_such_module", "No module named"),
    ],
)
def test_survives_what_drivers_do(monkeypatch, code, says):
    monkeypatch.setattr(gl, "_TRIAL", code)
    if "sleep" in code:
        monkeypatch.setattr(gl, "_PATIENCE", 0.5)
    renderer, fault = gl._tried("egl")
    assert renderer == ""
    assert says in fault


def test_survives_a_python_that_cannot_be_started(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    assert "No such file" in gl._tried("egl")[1]


def test_leaves_the_environment_alone():
    before = dict(os.environ)
    gl.find()
    assert dict(os.environ) == before


@pytest.mark.parametrize("wish", ["nonsense", "osmesa"])
def test_mujoco_is_imported_whatever_the_environment_says(wish):
    # On its own, since the package imports MuJoCo before it can be asked.
    code = (
        "import importlib.util, os, sys; "
        "spec = importlib.util.spec_from_file_location('gl', sys.argv[1]); "
        "gl = importlib.util.module_from_spec(spec); sys.modules['gl'] = gl; spec.loader.exec_module(gl); "
        "gl.import_mujoco(); import mujoco; mujoco.MjSpec().compile(); print(os.environ['MUJOCO_GL'])"
    )
    file = importlib.util.find_spec("chilopod.twin.gl").origin
    command, environment = [sys.executable, "-c", code, file], {**os.environ, "MUJOCO_GL": wish}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, wish), done.stderr
