"""Builds chilopod as it is handed out, into the folder it is given: ``python packaging/build.py dist``.

The source distribution is built of what git tracks, whatever else lies about, and the wheel of the source distribution,
which so has all that a wheel takes. What is in them and does not belong there is an error, and what is missing too.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parent.parent
SOURCES = "src/"
ADDED_TO_SDIST = {"PKG-INFO", "setup.cfg"}
ADDED_TO_WHEEL = {"METADATA", "RECORD", "WHEEL", "entry_points.txt", "licenses/LICENSE", "top_level.txt"}


def build(folder: Path) -> tuple[Path, Path]:
    """Build both.

    Parameters
    ----------
    folder
        Where they go; made if need be, and what it has of the same names is replaced.

    Returns
    -------
    sdist, wheel
        Their files.
    """
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="chilopod-build-") as scratch:
        tree = Path(scratch) / "tree"
        for name in tracked():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tree / name)
        sdist = _built("sdist", tree, folder)
        with tarfile.open(sdist) as archive:
            archive.extractall(scratch, filter="data")
        wheel = _built("wheel", Path(scratch) / sdist.name.removesuffix(".tar.gz"), folder)
    return sdist, wheel


def tracked() -> set[str]:
    """The files that git tracks, as paths from the root; those of its own and of CI left out."""
    listed = subprocess.run(["git", "-C", str(ROOT), "ls-files", "-z"], capture_output=True, text=True, check=True)
    names = {name for name in listed.stdout.split("\0") if name and not name.startswith(".")}
    return {name for name in names if (ROOT / name).exists()}


def faults(sdist: Path, wheel: Path) -> list[str]:
    """What they have too much and too little, a line each; empty if both are as they should be."""
    files = tracked()
    package = {name.removeprefix(SOURCES) for name in files if name.startswith(SOURCES)}
    with tarfile.open(sdist) as archive:
        # All is in one folder, and setuptools leaves in it what it makes beside the sources.
        paths = [PurePosixPath(each.name) for each in archive if each.isfile()]
    in_sdist = {"/".join(path.parts[1:]) for path in paths if not any(".egg-info" in part for part in path.parts)}
    with zipfile.ZipFile(wheel) as archive:
        in_wheel = set(archive.namelist())
    info = "-".join(wheel.name.split("-")[:2]) + ".dist-info"
    return [
        *_differences(sdist, in_sdist, files | ADDED_TO_SDIST),
        *_differences(wheel, in_wheel, package | {f"{info}/{name}" for name in ADDED_TO_WHEEL}),
    ]


def _built(what: str, source: Path, folder: Path) -> Path:
    """What setuptools makes of a tree."""
    code = f"import sys; from setuptools import build_meta; print(build_meta.build_{what}(sys.argv[1]))"
    done = subprocess.run([sys.executable, "-c", code, str(folder)], cwd=source, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"error: the {what} cannot be built\n{done.stderr}")
    return folder / done.stdout.splitlines()[-1]


def _differences(file: Path, there: set[str], wanted: set[str]) -> list[str]:
    return [
        *(f"{file.name} lacks {name}" for name in sorted(wanted - there)),
        *(f"{file.name} should not have {name}" for name in sorted(there - wanted)),
    ]


def main() -> int:
    """Build into the folder named on the command line, and say what is wrong with it."""
    built = build(Path(sys.argv[1]))
    wrong = faults(*built)
    for file in built:
        print(f"{file} ({file.stat().st_size / 1000:.0f} kB)")
    for line in wrong:
        print(f"error: {line}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
