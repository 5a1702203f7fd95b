"""``chilopod doctor``: check of the installation, with the command that repairs each fault."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import typer

from chilopod.cli.options import JsonOption, print_result
from chilopod.cli.progress import progress_bar
from chilopod.errors import OutputError, briefly

_IMPORTED = ("numpy", "scipy", "numba", "mujoco", "xarray", "matplotlib", "av")
_PACKAGES = {name: "mujoco-core" if name == "mujoco" else name for name in _IMPORTED}
"""Names of packages in imports, and in package registries."""

BROKEN = 3
"""Exit code where an essential part is missing."""


@dataclass(frozen=True)
class Finding:
    """Result of a check, and the line that repairs a missing part; it is essential if nothing works without it."""

    name: str
    says: str
    mend: str = ""
    essential: bool = False
    looked: bool = True

    @property
    def mark(self) -> str:
        """Sign for readers who skim."""
        return "✗" if self.mend else "✓" if self.looked else "?"

    def as_json(self) -> dict[str, object]:
        """Plain values; null for a missing part, and where no repair is needed."""
        found, mend = self.says if self.looked else None, self.mend or None
        return {"name": self.name, "found": found, "mend": mend, "essential": self.essential}


def doctor(as_json: JsonOption = False) -> None:
    """Check that all parts that chilopod needs are installed, and print the command that repairs a missing one.

    The exit code is 0, or 3 if an essential part is missing. OpenGL and the encoder are needed only for films and
    pictures in 3-D.

    Example: chilopod doctor --json
    """
    with progress_bar("doctor"):
        found = [*_versions(), *(_guarded(name, look) for name, look in _LOOKS.items())]
    broken = any(each.mend and each.essential for each in found)
    lines, width = [], max(len(each.name) for each in found)
    for each in found:
        lines.append(f"{each.mark} {each.name:<{width}}  {each.says}")
        lines += [f"  {'':<{width}}  to mend it: {each.mend}"] * bool(each.mend)
    print_result({"healthy": not broken, "findings": [each.as_json() for each in found]}, lines, as_json)
    if broken:
        raise typer.Exit(BROKEN)


def _versions() -> list[Finding]:
    import chilopod

    python = f"{platform.python_version()} ({platform.system()} {platform.machine()})"
    found = [Finding("chilopod", chilopod.__version__), Finding("python", python)]
    for module, package in _PACKAGES.items():
        # What uses a package here may be able to import it where it cannot be imported alone, or the other way round.
        fault = _fault({"mujoco": "chilopod.twin", "numba": "chilopod.integrate"}.get(module, module))
        if fault:
            wishes = [] if "No module" in fault else settings(module)
            mend = f"unset {' '.join(wishes)}" if wishes else _again(package)
            found.append(Finding(module, f"cannot be imported: {fault}", mend, essential=True))
        else:
            found.append(Finding(module, _version(package)))
    return found


def settings(module: str) -> list[str]:
    """Environment variables that configure a package, such as the name of a backend."""
    return sorted(name for name in os.environ if name.startswith(f"{module.upper()}_"))


def _version(package: str) -> str:
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "of unknown version"


def _fault(module: str) -> str:
    """Why a package cannot be imported; empty if it can."""
    try:
        import_module(module)
    except Exception as error:  # packages with compiled parts fail in many ways
        return briefly(error)
    return ""


def _kernels() -> tuple[str, ...]:
    from chilopod.processor import blas_kernels

    return (", ".join(f"{blas_kernels(name)} ({name})" for name in ("numpy", "scipy")),)


def _cache() -> tuple[str, ...]:
    from chilopod.output import check_folder
    from chilopod.planar.linear import propagate_batch

    folder, problem = propagate_batch.stats.cache_path, "no folder can be written"
    try:
        if folder is not None:
            return (str(check_folder(folder)),)
    except OutputError as error:
        problem = str(error)
    return f"{problem}, so every start compiles anew", "set NUMBA_CACHE_DIR to a folder that can be written"


def _drawing() -> tuple[str, ...]:
    from chilopod.twin import gl

    found = gl.find()
    if found.backend is None:
        return f"{found.missing}; all but films and stills in 3-D works", found.mend
    return (f"{found.backend}: {found.renderer}",)


def _encoder() -> tuple[str, ...]:
    from chilopod.show.scene.encoder import has_encoder

    return ("H.264",) if has_encoder() else ("PyAV has no H.264; all but mp4 films works", _again("av"))


def _fonts() -> tuple[str, ...]:
    import matplotlib as mpl
    from matplotlib.font_manager import FontProperties, findfont

    from chilopod.show.style import house_style

    with house_style():
        families = list(mpl.rcParams["font.family"])
    missing = []
    for family in families:
        try:
            findfont(FontProperties(family=[family]), fallback_to_default=False)
        except ValueError:
            missing.append(family)
    if missing:
        return f"no {', '.join(missing)}; figures take another", _again("matplotlib")
    return (", ".join(families),)


_LOOKS: dict[str, Callable[[], tuple[str, ...]]] = {
    "processor": lambda: (import_module("chilopod.processor").processor(),),
    "compiled for": lambda: (import_module("chilopod.processor").compiled_for(),),
    "BLAS kernels": _kernels,
    "cores": lambda: (f"{import_module('chilopod.cores').cores()} to be used",),
    "numba threads": lambda: (str(import_module("numba").get_num_threads()),),
    "compile cache": _cache,
    "OpenGL": _drawing,
    "mp4 encoder": _encoder,
    "fonts": _fonts,
}
"""Further checks: finding, and the line that repairs a missing part."""


def _again(package: str) -> str:
    return f"{Path(sys.executable).name or 'python'} -m pip install --force-reinstall {package}"


def _guarded(name: str, look: Callable[[], tuple[str, ...]]) -> Finding:
    """Finding of a check, even where a package that it uses is missing."""
    try:
        says, *mend = look()
        return Finding(name, says, "".join(mend))
    except Exception as error:  # said once more, among the versions, with what mends it
        return Finding(name, f"cannot be looked at: {briefly(error)}", looked=False)
