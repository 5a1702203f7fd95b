"""Settings of all tests."""

import os
import platform
import sys
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import settings

CPUINFO = Path("/proc/cpuinfo")
# One of the processes has other kernels for linear algebra than the machine would choose: its rounding is that of
# another processor. They are chosen when numpy is imported.
if os.environ.get("PYTEST_XDIST_WORKER") == "gw1" and platform.machine() == "x86_64" and CPUINFO.exists():
    os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell" if "avx512vl" in CPUINFO.read_text() else "Nehalem")

from chilopod.robot import Robot, load_robot  # noqa: E402

# In CI the same examples every time, so that a submission is judged by its own changes, and few, as more would be found
# once; at a desk new ones each run, many with --hypothesis-profile=deep. No deadlines: how long an example takes
# is the machine's affair.
settings.register_profile("desk", max_examples=40, deadline=None)
settings.register_profile("ci", max_examples=15, derandomize=True, deadline=None)
settings.register_profile("deep", max_examples=1000, deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "desk")


@pytest.fixture(scope="session")
def former() -> Robot:
    """The planar robot with the constants for which other programs computed the numbers that ours are held against."""
    return load_robot("aoi2022-planar").set_from_text(
        ["ground.friction=256.5 N*s/m", "legs.half_width=72.8 mm", "legs.forward_offset=48 mm"]
    )


@pytest.fixture(scope="session")
def kept(tmp_path_factory) -> Path:
    """Where all tests, in whatever process, keep the trials of studies: each is walked once a session."""
    root = tmp_path_factory.getbasetemp()
    folder = (root.parent if os.environ.get("PYTEST_XDIST_WORKER") else root) / "trials"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session")
def tiny(kept, tmp_path_factory) -> SimpleNamespace:
    """The main job with every section, as small as it gets: its folder, what was found, the fractions that were told of
    each section, what failed, all text painted.

    Tests of one file run in one process, so all that need it are in one. Modes of walks of the whole robot are followed
    from the leading ones of the first robot, of which the derivative costs most.
    """
    from chilopod.analysis.cycle_multipliers import AMPLITUDE, finite_modes
    from chilopod.paper.page import Report
    from chilopod.paper.registry import load_sections
    from chilopod.paper.robot import walks, why
    from chilopod.paper.section import Context, Size, reproduce
    from helpers.texts import watched

    first = []

    def modes(cycle, start, bends, amplitude=AMPLITUDE, cycles=20, basis=None):
        found = finite_modes(cycle, start, bends, amplitude, cycles, basis or (first[0] if first else None))
        first.append(found[-1])
        return found

    context, folder = Context(size=Size.TINY, folder=kept), tmp_path_factory.mktemp("tiny")
    sections, told = load_sections(), defaultdict(list)
    with watched() as painted, pytest.MonkeyPatch.context() as patch, Report(sections, context, folder) as report:
        for module in (walks, why):
            patch.setattr(module, "finite_modes", modes)
        found = reproduce(
            sections,
            context,
            lambda what, done, words: told[what].append(done),
            lambda found, section: report.add(found, [section]),
        )
    return SimpleNamespace(folder=folder, found=found, told=told, failures=report.failures, painted=painted)


@pytest.fixture(autouse=True)
def no_figure_stays_open():
    """Figures of pyplot are of the whole process: none is left to the tests that follow in it."""
    yield
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        pyplot.close("all")


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    from helpers.browser import CHROMIUM, Browser

    if CHROMIUM is None:
        pytest.skip("there is no Chromium")
    with Browser(tmp_path_factory.mktemp("browser")) as opened:
        yield opened


BEGUN = {"truth": 1, "trials": 2}
"""Folders whose tests come before others."""


def pytest_collection_modifyitems(items) -> None:
    """What takes longest is begun first, and beside what needs other compiled code; what waits for processes of its
    own, and files with slow tests, are not left for the end, where nothing else would run meanwhile."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}

    def turn(item) -> int:
        return 0 if "tiny" in item.fixturenames else BEGUN.get(item.path.parent.name, 4 - (item.path in slow))

    items.sort(key=turn)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    """Say with a failure whose kernels it was."""
    report = yield
    if report.failed and "OPENBLAS_CORETYPE" in os.environ:
        report.sections.append(("processor", f"OPENBLAS_CORETYPE={os.environ['OPENBLAS_CORETYPE']}"))
    return report
