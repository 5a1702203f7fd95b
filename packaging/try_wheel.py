"""Tries a wheel as somebody gets it: ``python packaging/try_wheel.py dist/chilopod-0.1.0-py3-none-any.whl``.

It is installed into an empty environment, and its commands run in an empty folder, with nothing of the repository in
reach but the lock file's versions. Each extra is first missed, in one line, then installed and used. It downloads what
pip has not kept, and takes some minutes.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

LOCK = Path(__file__).resolve().parent.parent / "requirements.lock"
COMMANDS = {
    "chilopod --version": "chilopod ",
    "python -m chilopod --help": "Many-legged robots",
    "chilopod doctor": "chilopod",
    "chilopod robot show aoi2022": "stiffness",
    "chilopod robot export aoi2022 --out robot.xml": "robot.xml",
    'chilopod walk aoi2022-planar --duration "2 s"': "2 s",
    'chilopod walk aoi2022 --engine twin --duration "1 s"': "1 s",
    'chilopod turn aoi2022-planar --target "45 deg, 1.3 m" --out turn': "arrived",
}
"""What has to work without any extra, and a word of what it prints."""
WRITTEN = ("robot.xml", "turn/turn.html")
EXTRAS = {
    "cluster": ('chilopod walk aoi2022-planar --duration "2 s" --seed 1 --repeats 2 --cluster 1', "2 walks"),
    "docs": ("python -m sphinx --version", "sphinx"),
    "gym": ("python -c \"import gymnasium, chilopod.gym; print(gymnasium.spec('chilopod/Turn-v0').id)\"", "Turn-v0"),
    "live": ('chilopod live --port 0 --duration "1 s"', "walks at http://localhost:"),
}
"""For each extra what takes it, and a word of what it then prints."""
NOT_OURS = ("docs", "gym")
"""Without these extras it is not chilopod that says so."""


def main() -> int:
    """Try the wheel named on the command line."""
    wheel = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory(prefix="chilopod-wheel-") as scratch:
        environment, folder = Path(scratch) / "environment", Path(scratch) / "folder"
        folder.mkdir()
        venv.create(environment, with_pip=True)
        print(f"Installing {wheel.name} into an empty environment", flush=True)
        install(environment, folder, str(wheel))
        for command, word in COMMANDS.items():
            run(environment, folder, command, word)
        for name in WRITTEN:
            assert (folder / name).stat().st_size > 0, f"{name} was not written"
        for extra, (command, _) in EXTRAS.items():
            if extra not in NOT_OURS:
                run(environment, folder, command, f'pip install "chilopod[{extra}]"', code=2)
        for extra, (command, word) in EXTRAS.items():
            print(f"Installing the extra {extra}", flush=True)
            install(environment, folder, f"{wheel}[{extra}]")
            run(environment, folder, command, word)
    return 0


def install(environment: Path, folder: Path, what: str) -> None:
    """With pip, in the versions of the lock file."""
    command = ["python", "-m", "pip", "--quiet", "--disable-pip-version-check", "--no-input", "install"]
    call(environment, folder, [*command, "-c", str(LOCK), what])


def run(environment: Path, folder: Path, command: str, word: str, code: int = 0) -> None:
    """Run a command line, and hold its exit code and what it prints; an error is one line."""
    print(f"  {command}", flush=True)
    done = call(environment, folder, shlex.split(command), code)
    assert word in done.stdout + done.stderr, f"{word!r} is not in what it prints:\n{done.stdout}{done.stderr}"
    if code:
        assert done.stderr.count("\n") == 1, f"not one line:\n{done.stderr}"


def call(environment: Path, folder: Path, words: list[str], code: int = 0) -> subprocess.CompletedProcess[str]:
    """Run a program of the environment, which knows of no other."""
    programs = environment / ("Scripts" if os.name == "nt" else "bin")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
    kept["PATH"] = f"{programs}{os.pathsep}{kept['PATH']}"
    command = [str(programs / words[0]), *words[1:]]
    done = subprocess.run(command, cwd=folder, env=kept, capture_output=True, text=True, check=False)
    assert done.returncode == code, f"exit code {done.returncode}:\n{done.stdout}{done.stderr}"
    return done


if __name__ == "__main__":
    sys.exit(main())
