"""Packages are light: a verb loads what it needs itself, and nothing of its neighbours."""

import importlib
import subprocess
import sys

import pytest

import chilopod
from chilopod import analysis, planar, tasks, trials
from chilopod.tasks import identify

HEAVY = ("mujoco", "matplotlib", "xarray", "pandas", "h5netcdf", "av", "cmaes", "jinja2")
PACKAGES = (chilopod, analysis, planar, tasks, identify, trials)


def loaded(code, *modules):
    """Which of the modules a fresh process has after running some code."""
    asked = f"import sys\n{code}\nprint(*[name for name in {modules!r} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, timeout=120, check=True)
    return set(result.stdout.split())


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.__name__)
def test_a_package_alone_loads_nothing(package):
    assert loaded(f"import {package.__name__}", *HEAVY, "numpy", "scipy", "numba", "pydantic") == set()


def test_the_theory_loads_no_engine_in_3d_no_drawing_and_no_records():
    assert loaded("from chilopod.analysis import bifurcations, pitchfork, straight_walk", *HEAVY) == set()


def test_what_walks_loads_the_twin_only_where_it_walks():
    code = "from chilopod.tasks import turn, radius_law\nfrom chilopod.trials import NONE, Trial, run, together"
    assert loaded(code, "mujoco", "matplotlib", "cmaes") == set()


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.__name__)
def test_every_name_is_there_and_listed(package):
    for name in package.__all__:
        assert getattr(package, name) is not None
        assert name in dir(package)
    with pytest.raises(AttributeError, match="nonsense"):
        _ = package.nonsense


def test_a_verb_named_like_its_module_is_the_verb_whatever_was_loaded_first():
    for name in (
        "chilopod.analysis.straight_walk",
        "chilopod.tasks.turn",
        "chilopod.tasks.radius_law",
        "chilopod.trials.run",
    ):
        package, _, verb = name.rpartition(".")
        loaded(f"import {name}\nfrom {package} import {verb}\nassert callable({verb}) and callable({name})")
        assert getattr(importlib.import_module(name), verb) is getattr(sys.modules[package], verb)
