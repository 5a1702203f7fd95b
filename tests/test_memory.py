"""How much memory there is: the least of what machine, container and process may have."""

import resource
from pathlib import Path

import pytest

from chilopod import memory


@pytest.mark.parametrize(
    ("size", "words"),
    [(0.0, "0 bytes"), (999.0, "999 bytes"), (999.9e3, "1 MB"), (2.44e9, "2.44 GB"), (5e18, "5e+03 PB")],
)
def test_sizes_in_words(size, words):
    assert memory.in_words(size) == words


def test_of_a_container(monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "_CGROUPS", tmp_path)
    free = memory.available()
    assert 1e6 < free < float("inf")
    for name, text in {"max": "3000000", "current": "2500000", "stat": "anon 7\ninactive_file 300000\n"}.items():
        (tmp_path / f"memory.{name}").write_text(f"{text}\n")
    assert memory.available() == 800_000.0
    (tmp_path / "memory.max").write_text("max\n")
    assert memory.available() > 1e6


def test_of_a_process_with_a_limit():
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + 10**9, hard))
    try:
        assert 0.9e9 < memory.available() <= 1e9
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
