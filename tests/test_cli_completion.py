"""A shell completes commands, options and choices; ``python -m chilopod`` is the command."""

import os
import subprocess
import sys

import pytest


def python(*arguments, **more):
    return subprocess.run(
        [sys.executable, "-m", "chilopod", *arguments],
        capture_output=True, text=True, timeout=60, check=False, env={**os.environ, **more},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("chilopod bi", ["bifurcation"]),
        ("chilopod robot ex", ["export"]),
        ("chilopod turn my.toml --strat", ["--strategy"]),
        ("chilopod turn my.toml --strategy p", ["pitchfork"]),
        ("chilopod walk my.toml --engine t", ["twin"]),
        ("chilopod reproduce --only mo", ["mode", "modules", "movies"]),
    ],
)
def test_a_shell_completes(typed, completed):
    words = {"_CHILOPOD_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(len(typed.split()) - 1)}
    found = python(**words)
    assert (found.returncode, found.stdout.split()) == (0, completed)


def test_an_instruction_that_is_none_is_one_line():
    found = python("doctor", _CHILOPOD_COMPLETE="nosuch")
    assert (found.returncode, found.stdout) == (2, "")
    assert found.stderr.startswith("error: _CHILOPOD_COMPLETE = 'nosuch': must be the instruction")
    assert found.stderr.count("\n") == 1


def test_the_script_for_a_shell_asks_this_command():
    found = python("--show-completion", "bash", _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1")
    assert found.returncode == 0
    assert "_CHILOPOD_COMPLETE=complete_bash" in found.stdout


def test_the_package_is_the_command():
    found = python("--help")
    assert found.returncode == 0
    assert found.stdout.startswith("Usage: chilopod ")
    assert "--install-completion" in found.stdout
