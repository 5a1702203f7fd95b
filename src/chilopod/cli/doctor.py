"""``chilopod doctor``: is everything here that chilopod needs, and what mends it if not?"""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import typer

from chilopod.cli.options import JsonOption, print_json
from chilopod.cli.progress import progress_bar

_PACKAGES = {
    "numpy": "numpy",
    "scipy": "scipy",
    "numba": "numba",
    "mujoco": "mujoco-core",
    "xarray": "xarray",
    "matplotlib": "matplotlib",
    "av": "av",
}
"""Packages that are imported, and their names where they come from."""

BROKEN = 3
"""Exit code where something is missing that nothing works without."""


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes
    ----------
    name
        Name of the check.
    says
        Result of the check.
    mend
        The line that mends it; empty if nothing is missing.
    essential
        True if nothing works without it.
    looked
        True if it could be looked at.
    """

    name: str
    says: str
    mend: str = ""
    essential: bool = False
    looked: bool = True

    @property
    def mark(self) -> str:
        """For those who skim."""
        return "✗" if self.mend else "✓" if self.looked else "?"


def doctor(as_json: JsonOption = False) -> None:
    """Say what is here that chilopod needs, and of everything that is missing the one line that mends it.

    The exit code is 0, or 3 if something is missing that nothing works without. Without OpenGL or an encoder all but
    films and pictures in 3-D works.
    """
    with progress_bar("doctor"):
        found = [
            finding
            for look in (_versions, _processor, _cores, _cache, _drawing, _encoder, _fonts)
            for finding in look()
        ]
    broken = any(each.mend and each.essential for each in found)
    if as_json:
        findings = [
            {
                "name": each.name,
                "found": each.says if each.looked else None,
                "mend": each.mend or None,
                "essential": each.essential,
            }
            for each in found
        ]
        print_json({"healthy": not broken, "findings": findings})
    else:
        width = max(len(each.name) for each in found)
        for each in found:
            typer.echo(f"{each.mark} {each.name:<{width}}  {each.says}")
            if each.mend:
                typer.echo(f"  {'':<{width}}  to mend it: {each.mend}")
    if broken:
        raise typer.Exit(BROKEN)


def _versions() -> list[Finding]:
    import chilopod

    found = [
        Finding("chilopod", chilopod.__version__),
        Finding("python", f"{platform.python_version()} ({platform.system()} {platform.machine()})"),
    ]
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
    """Variables of the environment by which a package is told something, such as a backend that it may not have."""
    return sorted(name for name in os.environ if name.startswith(f"{module.upper()}_"))


def _version(package: str) -> str:
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "of unknown version"


def _fault(module: str) -> str:
    """Why a package cannot be imported; empty if it can."""
    from importlib import import_module

    from chilopod.errors import briefly

    try:
        import_module(module)
    except Exception as error:  # packages with compiled parts fail in many ways
        return briefly(error)
    return ""


def _processor() -> list[Finding]:
    from chilopod.processor import blas_kernels, compiled_for, processor

    def kernels() -> Finding:
        return Finding("BLAS kernels", ", ".join(f"{blas_kernels(name)} ({name})" for name in ("numpy", "scipy")))

    for_what = _guarded("compiled for", lambda: Finding("compiled for", compiled_for()))
    return [Finding("processor", processor()), for_what, _guarded("BLAS kernels", kernels)]


def _cores() -> list[Finding]:
    from chilopod.cores import cores

    found = [Finding("cores", f"{cores()} to be used")]

    def threads() -> Finding:
        import numba

        return Finding("numba threads", str(numba.get_num_threads()))

    return [*found, _guarded("numba threads", threads)]


def _cache() -> list[Finding]:
    def cache() -> Finding:
        from chilopod.planar.linear import propagate_batch

        folder, mend = propagate_batch.stats.cache_path, "set NUMBA_CACHE_DIR to a folder that can be written"
        if folder is None:
            return Finding("compile cache", "no folder can be written, so every start compiles anew", mend)
        try:
            return Finding("compile cache", str(check_folder(folder)))
        except OutputError as error:
            return Finding("compile cache", f"{error}, so every start compiles anew", mend)

    from chilopod.errors import OutputError
    from chilopod.output import check_folder

    return [_guarded("compile cache", cache)]


def _drawing() -> list[Finding]:
    def drawing() -> Finding:
        from chilopod.twin import gl

        found = gl.find()
        if found.backend is None:
            return Finding("OpenGL", f"{found.missing}; all but films and stills in 3-D works", found.mend)
        return Finding("OpenGL", f"{found.backend}: {found.renderer}")

    return [_guarded("OpenGL", drawing)]


def _encoder() -> list[Finding]:
    def encoder() -> Finding:
        from chilopod.show.scene.encoder import has_encoder

        if not has_encoder():
            return Finding("mp4 encoder", "PyAV has no H.264; all but mp4 films works", _again("av"))
        return Finding("mp4 encoder", "H.264")

    return [_guarded("mp4 encoder", encoder)]


def _fonts() -> list[Finding]:
    def fonts() -> Finding:
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
            return Finding("fonts", f"no {', '.join(missing)}; figures take another", _again("matplotlib"))
        return Finding("fonts", ", ".join(families))

    return [_guarded("fonts", fonts)]


def _again(package: str) -> str:
    return f"{Path(sys.executable).name or 'python'} -m pip install --force-reinstall {package}"


def _guarded(name: str, look: Callable[[], Finding]) -> Finding:
    """Finding of a check, even where a package that it takes is not there."""
    from chilopod.errors import briefly

    try:
        return look()
    except Exception as error:  # said once more, among the versions, with what mends it
        return Finding(name, f"cannot be looked at: {briefly(error)}", looked=False)
