"""Packages are light: a verb loads what it needs itself, and nothing of its neighbours."""

import importlib
import subprocess
import sys

import pytest

import chilopod
from chilopod import analysis, planar, show, tasks, trials
from chilopod.tasks import identify

HEAVY = ("mujoco", "matplotlib", "xarray", "pandas", "h5netcdf", "av", "cmaes", "jinja2")
PACKAGES = (chilopod, analysis, planar, show, tasks, identify, trials)


PAPER = tuple(f"chilopod.paper{part}" for part in ("", ".printed", ".scatter", ".section", ".registry", ".table"))
THEORY = "from chilopod.analysis import bifurcations, pitchfork, straight_walk"
WALKS = "from chilopod.tasks import turn, radius_law\nfrom chilopod.trials import NONE, Trial, run, together"
PAGE = "import chilopod.live.server, chilopod.gym.envs, chilopod.show.files"
NAMES = tuple(f"chilopod.{name}" for name in ("analysis.straight_walk", "tasks.turn", "tasks.radius_law", "trials.run"))
IMPORTED = "import {0}\nfrom {1} import {2}\nassert callable({2}) and callable({0})"
VERBS = {name: IMPORTED.format(name, *name.rpartition(".")[::2]) for name in NAMES}
ASKED = {THEORY: HEAVY, WALKS: ("mujoco", "matplotlib", "cmaes", "distributed"), PAGE: PAPER}
ASKED |= dict.fromkeys(VERBS.values(), ())
# Each in a process of its own, which has everything of others loaded already.
RUNS = """
import os, sys
import numba, numpy, pydantic, scipy.interpolate, scipy.linalg, scipy.optimize
for code, asked in {asked}.items():
    if "xarray" not in asked:
        import xarray
    if not (child := os.fork()):
        exec(code, {{}})
        print(*[name for name in asked if name in sys.modules], flush=True)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0, code
"""


def ran(code):
    """What a fresh process prints, line by line."""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True)
    return result.stdout.splitlines()


def loaded(code, *modules):
    """Which of the modules a fresh process has after running some code."""
    found = ran(f"import sys\n{code}\nprint(*[name for name in {modules!r} if name in sys.modules])")
    return set(" ".join(found).split())


@pytest.fixture(scope="module")
def after():
    """Which of the modules that are asked for are there after each import."""
    return dict(zip(ASKED, ran(RUNS.format(asked=ASKED)), strict=True))


def test_a_package_alone_loads_nothing():
    """Each in a process of its own."""
    packages = [package.__name__ for package in PACKAGES]
    each = "if not os.fork():\n  __import__(name)\n  break\n os.wait()"
    code = f"import os\nfor name in {packages}:\n {each}"
    assert loaded(code, *HEAVY, "numpy", "scipy", "numba", "pydantic", *packages) == set(packages)


def test_the_theory_loads_no_engine_in_3d_no_drawing_and_no_records(after):
    assert after[THEORY] == ""


def test_a_misspelt_name_is_noticed_before_the_command_loads_what_it_computes_with():
    robot = ("aoi2022-planar", "--engine", "plana")
    wrong = [
        ("course", robot[0], "--targets", "slalmo"),
        ("course", *robot, "--targets", "slalom"),
        ("course", robot[0], "--targets", "slalom", "--controller", "no.such:Thing"),
        ("turn", *robot, "--target", "45 deg, 1.3 m"),
        ("walk", *robot),
        ("bifurcation", robot[0], "--parameter", "springs.stif"),
    ]
    code = f"from chilopod.cli import main\nassert [main(each) for each in {wrong}] == [2] * {len(wrong)}"
    assert loaded(code, *HEAVY, "scipy", "numba") == set()


def test_what_walks_loads_the_twin_only_where_it_walks(after):
    assert after[WALKS] == ""


def test_the_live_page_and_the_environments_know_no_paper(after):
    assert after[PAGE] == ""


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.__name__)
def test_every_name_is_there_and_listed(package):
    for name in package.__all__:
        assert getattr(package, name) is not None
        assert name in dir(package)
    with pytest.raises(AttributeError, match="nonsense"):
        _ = package.nonsense


def test_a_verb_named_like_its_module_is_the_verb_whatever_was_loaded_first(after):
    for name, code in VERBS.items():
        assert after[code] == ""  # which it has asserted
        package, _, verb = name.rpartition(".")
        module = importlib.import_module(name)
        assert getattr(module, verb) is getattr(sys.modules[package], verb)
