"""``chilopod doctor``: all is found here, and what is missing comes with the line that mends it."""

import json
import os
import platform
import subprocess
import sys
from types import SimpleNamespace

import matplotlib.font_manager
import pytest

import chilopod
from chilopod import processor
from chilopod.cli import doctor, main
from chilopod.errors import OutputError
from chilopod.twin import gl


def examined(capsys, *arguments):
    code = main(["doctor", *arguments])
    captured = capsys.readouterr()
    assert all(line.startswith("doctor: ") for line in captured.err.splitlines())  # how long it takes, if it does
    return code, captured.out


def findings(capsys, code=0):
    returned, out = examined(capsys, "--json")
    assert returned == code
    found = json.loads(out)
    assert found["healthy"] is (code == 0)
    return {each["name"]: each for each in found["findings"]}


def test_all_is_here(capsys):
    found = findings(capsys)
    assert found["chilopod"]["found"] == chilopod.__version__
    assert found["fonts"]["found"] == "DejaVu Sans"
    assert int(found["numba threads"]["found"]) >= 1
    assert {*found} >= {"python", "numpy", "scipy", "numba", "mujoco", "xarray", "matplotlib", "av", "cores"}
    assert all(each["found"] for each in found.values())
    # Only a machine without a driver may lack something.
    assert {name for name, each in found.items() if each["mend"]} <= {"OpenGL"}
    if backend := gl.find().backend:
        assert backend in found["OpenGL"]["found"]


def test_processor_and_kernels(capsys, monkeypatch):
    found = findings(capsys)
    assert found["processor"]["found"] == processor.processor()
    assert found["compiled for"]["found"] == os.environ.get("NUMBA_CPU_NAME", processor.compiled_for())
    assert found["BLAS kernels"]["found"].count(")") == 2
    monkeypatch.setattr(processor, "_CORENAME", ["no_such_function"])
    assert findings(capsys)["BLAS kernels"]["found"] == "unknown (numpy), unknown (scipy)"
    monkeypatch.setattr(processor, "import_module", lambda name: SimpleNamespace(__file__="nowhere/at/all.py"))
    assert processor.blas_kernels("numpy") == "unknown"


@pytest.mark.parametrize("kernels", ["Haswell", "Nehalem"])
def test_the_kernels_that_are_asked_for_are_named(kernels):
    code = "from chilopod.processor import blas_kernels; print(blas_kernels('numpy'), blas_kernels('scipy'))"
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernels}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    if platform.machine() not in ("x86_64", "AMD64") or "unknown" in done.stdout:
        pytest.skip("another architecture, or another library")
    assert done.stdout.split() == [kernels, kernels]


def test_prints_a_line_each(capsys, monkeypatch):
    monkeypatch.setattr(gl, "find", lambda: gl.Found("egl", "a driver"))
    code, out = examined(capsys)
    assert code == 0
    lines = out.splitlines()
    assert len(lines) == len(findings(capsys))
    assert all(line.startswith("✓ ") and line.isprintable() for line in lines)


def test_without_opengl_and_encoder(capsys, monkeypatch):
    monkeypatch.setattr(gl, "find", lambda: gl.Found(None, missing="no OpenGL works", mend="plug one in"))
    monkeypatch.setattr("chilopod.show.scene.encoder.ENCODER", "no-such-encoder")
    found = findings(capsys)
    assert found["OpenGL"]["mend"] == "plug one in"
    assert "all but films and stills in 3-D works" in found["OpenGL"]["found"]
    assert "install" in found["mp4 encoder"]["mend"]
    assert "all but mp4 films works" in found["mp4 encoder"]["found"]
    code, out = examined(capsys)
    assert code == 0
    assert "✗ OpenGL" in out
    assert "to mend it: plug one in" in out


def test_without_font_and_cache(capsys, monkeypatch):
    def missing(*arguments, **more):
        raise ValueError

    def refused(path):
        raise OutputError("cannot be written", source="there")

    monkeypatch.setattr(matplotlib.font_manager, "findfont", missing)
    monkeypatch.setattr("chilopod.output.check_folder", refused)
    found = findings(capsys)
    assert "no DejaVu Sans" in found["fonts"]["found"]
    assert "there: cannot be written" in found["compile cache"]["found"]
    assert "NUMBA_CACHE_DIR" in found["compile cache"]["mend"]


@pytest.mark.parametrize("wish", [None, "osmesa"])
def test_without_something_essential(capsys, monkeypatch, wish):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    if wish:
        monkeypatch.setenv("MUJOCO_GL", wish)
    monkeypatch.setattr(doctor, "_fault", lambda module: "broken" if module in ("scipy", "chilopod.twin") else "")
    found = findings(capsys, code=3)
    assert found["scipy"]["essential"]
    assert found["scipy"]["mend"].endswith("-m pip install --force-reinstall scipy")
    assert ("MUJOCO_GL" in found["mujoco"]["mend"]) is (wish is not None)


def test_what_cannot_be_looked_at_is_said(capsys, monkeypatch):
    def broken():
        raise ImportError("no threads\nat all")

    monkeypatch.setattr("numba.get_num_threads", broken)
    found = findings(capsys)
    assert found["numba threads"]["found"] is None
    code, out = examined(capsys)
    assert code == 0
    assert "? numba threads" in out
    assert "no threads" in out
    assert "at all" not in out
