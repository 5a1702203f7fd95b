"""Choice of an OpenGL backend that can draw the robot off-screen. Only films and stills need one.

MuJoCo reads ``MUJOCO_GL`` once, when it is imported, and takes GLFW where it is not set: that needs a display. Here the
class that makes a context is taken from the backend's own module instead, so it does not matter whether MuJoCo has been
imported before. Before that, another process tries every backend, because a faulty driver crashes or hangs.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from chilopod.errors import OutputError, one_line

_PATIENCE: Final = 30.0  # s; a backend that works answers within one or two even on a busy machine
_LONGEST: Final = 100
_OFF: Final = ("disable", "disabled", "off", "false", "0")
_ANY: Final = ("", "enable", "enabled", "on", "true", "1")
_ALIAS: Final = {"glx": "glfw", "wgl": "glfw"}
_OWN: Final = {"linux": ("egl", "osmesa", "glfw"), "darwin": ("cgl", "glfw"), "win32": ("glfw",)}
_MESA: Final = "install Mesa's EGL (Debian and Ubuntu: apt install libegl1 libgl1 libgl1-mesa-dri)"
_PYTHON: Final = 'pip install "mujoco-core[rendering]"'

# Draws, because some drivers make contexts that cannot.
_TRIAL: Final = """
import importlib, sys
backend = importlib.import_module("mujoco." + sys.argv[1])
import mujoco
context = backend.GLContext(16, 16)
context.make_current()
model = mujoco.MjSpec().compile()
drawing, scene = mujoco.MjrContext(model, 50), mujoco.MjvScene(model, 10)
mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, drawing)
mujoco.mjr_render(mujoco.MjrRect(0, 0, 16, 16), scene, drawing)
from OpenGL import GL
print((GL.glGetString(GL.GL_RENDERER) or b"no name").decode(errors="replace"))
drawing.free()
context.free()
"""


@dataclass(frozen=True)
class Found:
    """Backend that was found, ``egl``, ``osmesa``, ``glfw`` or ``cgl``, and the name of its driver; or None, the
    missing part in a few words, and the remedy."""

    backend: str | None
    renderer: str = ""
    missing: str = ""
    mend: str = ""


@lru_cache(maxsize=1)
def find() -> Found:
    """Look for a backend: the one that ``MUJOCO_GL`` names, otherwise the first that works.

    The answer holds for the life of the process; the first call takes about a second.
    """
    wish = os.environ.get("MUJOCO_GL", "").lower().strip()
    known, wanted = _OWN.get(sys.platform, _OWN["linux"]), _ALIAS.get(wish, wish)
    if wish in _OFF:
        return Found(None, missing=f"drawing is switched off by MUJOCO_GL={wish}", mend="unset MUJOCO_GL")
    if wish not in _ANY and wanted not in known:
        return Found(None, missing=f"MUJOCO_GL={one_line(wish)} is no backend here", mend="unset MUJOCO_GL")
    windows = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY") or "egl" not in known
    faults, candidates = {}, (name for name in known if windows or name != "glfw")
    for name in candidates if wish in _ANY else (wanted,):
        renderer, fault = _tried(name)
        if not fault:
            return Found(name, renderer)
        faults[name] = fault
    mend = _MESA if "egl" in known else "install a driver for the graphics card"
    if any("No module named" in fault for fault in faults.values()):
        mend = _PYTHON
    elif wish not in _ANY:
        mend = "unset MUJOCO_GL"
    missing = "no OpenGL works: " + "; ".join(f"{name}: {fault}" for name, fault in faults.items())
    return Found(None, missing=missing, mend=mend)


def import_mujoco() -> None:
    """Import MuJoCo even if ``MUJOCO_GL`` names a missing backend, on which its own import fails."""
    try:
        importlib.import_module("mujoco")
    except ImportError:
        raise
    except Exception:  # whatever a driver's library raises
        wish = os.environ.get("MUJOCO_GL")
        if wish is None:
            raise
        os.environ["MUJOCO_GL"] = "disable"
        try:
            importlib.import_module("mujoco")
        finally:
            os.environ["MUJOCO_GL"] = wish


@contextmanager
def context(width: int, height: int) -> Iterator[None]:
    """Make OpenGL ready to draw off-screen within the block, at a size in pixels; OutputError with the remedy if no
    backend works."""
    found = find()
    if found.backend is None:
        raise OutputError(f"films and stills in 3-D need OpenGL; {found.missing}; to mend it: {found.mend}")
    made = importlib.import_module(f"mujoco.{found.backend}").GLContext(width, height)
    try:
        made.make_current()
        yield
    finally:
        made.free()


def _tried(name: str) -> tuple[str, str]:
    """Name of the driver of a backend, and its fault, if any."""
    # Without the folder that Python was started in, where a file could be called as a module is.
    command, backend = [sys.executable, "-P", "-c", _TRIAL, name], {**os.environ, "MUJOCO_GL": name}
    try:
        done = subprocess.run(command, env=backend, stdin=subprocess.DEVNULL, capture_output=True, timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        return "", f"gave no answer in {_PATIENCE:g} s"
    except OSError as error:
        return "", error.strerror or "cannot be tried"
    if done.returncode < 0:
        return "", f"crashes (signal {-done.returncode})"
    printed = (done.stderr if done.returncode else done.stdout).decode(errors="replace").strip().splitlines()
    last = one_line(printed[-1]) if printed else ""
    if not done.returncode:
        return last, ""
    # PyOpenGL's message about a missing library.
    if "'NoneType' object has no attribute" in last or "Unable to load" in last:
        return "", "its library is not installed"
    return "", last[:_LONGEST] or f"fails with exit code {done.returncode}"
