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


def loaded(code, *modules):
    """Which of the modules a fresh process has after running some code."""
    asked = f"import sys\n{code}\nprint(*[name for name in {modules!r} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, timeout=120, check=True)
    return set(result.stdout.split())


def test_a_package_alone_loads_nothing():
    """Each in a process of its own."""
    packages = [package.__name__ for package in PACKAGES]
    each = "if not os.fork():\n  __import__(name)\n  break\n os.wait()"
    code = f"import os\nfor name in {packages}:\n {each}"
    assert loaded(code, *HEAVY, "numpy", "scipy", "numba", "pydantic", *packages) == set(packages)


def test_the_theory_loads_no_engine_in_3d_no_drawing_and_no_records():
    assert loaded("from chilopod.analysis import bifurcations, pitchfork, straight_walk", *HEAVY) == set()


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


def test_what_walks_loads_the_twin_only_where_it_walks():
    code = "from chilopod.tasks import turn, radius_law\nfrom chilopod.trials import NONE, Trial, run, together"
    assert loaded(code, "mujoco", "matplotlib", "cmaes", "distributed") == set()


def test_the_live_page_and_the_environments_know_no_paper():
    code = "import chilopod.live.server, chilopod.gym.envs, chilopod.show.files"
    paper = [f"chilopod.paper{part}" for part in ("", ".printed", ".scatter", ".section", ".registry", ".table")]
    assert loaded(code, *paper) == set()


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.__name__)
def test_every_name_is_there_and_listed(package):
    for name in package.__all__:
        assert getattr(package, name) is not None
        assert name in dir(package)
    with pytest.raises(AttributeError, match="nonsense"):
        _ = package.nonsense


# Each in a process of its own, which has everything of others loaded already.
VERBS = """
import os
import numba, pydantic, scipy.interpolate, scipy.optimize, xarray
for name in {names}:
    child = os.fork()
    if not child:
        package, _, verb = name.rpartition(".")
        code = f"import {{name}}\\nfrom {{package}} import {{verb}}\\nassert callable({{verb}}) and callable({{name}})"
        exec(code, {{}})
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0, name
"""


def test_a_verb_named_like_its_module_is_the_verb_whatever_was_loaded_first():
    names = "analysis.straight_walk", "tasks.turn", "tasks.radius_law", "trials.run"
    loaded(VERBS.format(names=[f"chilopod.{name}" for name in names]))
    for package, _, verb in (f"chilopod.{name}".rpartition(".") for name in names):
        module = importlib.import_module(f"{package}.{verb}")
        assert getattr(module, verb) is getattr(sys.modules[package], verb)
