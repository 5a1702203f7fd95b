"""What all benchmarks share: medians, the machine in words, and the tables in README.md."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median

from chilopod.cores import cores

README = Path(__file__).with_name("README.md")


def median_seconds(
    call: Callable[[], object],
    budget: float = 1.0,
    at_least: int = 5,
    clock: Callable[[], float] = time.perf_counter,
) -> float:
    """Median time of one call by a clock after a warm-up call, over as many calls as the budget (seconds) allows."""
    call()
    times: list[float] = []
    while len(times) < at_least or (sum(times) < budget and len(times) < 1000):
        start = clock()
        call()
        times.append(clock() - start)
    return median(times)


def machine() -> str:
    """Processor, cores, system, Python and versions of what is measured, in one sentence."""
    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        models = [line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line]
        name = models[0] if models else name
    packages = []
    for package in ("chilopod", "numpy", "scipy", "numba", "heyoka", "numbalsoda"):
        try:
            packages.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            packages.append(f"no {package}")
    today = datetime.now(UTC).date().isoformat()
    system = f"{platform.system()}, Python {platform.python_version()}"
    return f"{name}, {cores()} cores, {system}; {', '.join(packages)}; {today}."


def duration(seconds: float) -> str:
    """Three digits and a unit."""
    return f"{seconds * 1e3:.3g} ms" if seconds < 1 else f"{seconds:.3g} s"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def write_section(name: str, text: str) -> None:
    """Print `text`, and put it between the lines <!-- name --> and <!-- /name --> of README.md."""
    print(text)
    begin, end = f"<!-- {name} -->\n", f"<!-- /{name} -->"
    before, rest = README.read_text(encoding="utf-8").split(begin)
    after = rest.split(end)[1]
    README.write_text(f"{before}{begin}{text}\n{end}{after}", encoding="utf-8")
