"""Numbers in lanes: the same bits in any number of lanes and beside any others, and the functions of them."""

import json
import os
import runpy
import subprocess
import sys
from ctypes.util import find_library

import numpy as np
import pytest

from chilopod import compiled
from chilopod.compiled import njit
from chilopod.dual import cos_sin, reciprocal
from chilopod.lanes import LANES, any_less, as_lanes, choose, exponential, larger, square_root


def _in_lanes(width):
    @njit
    def compute(a, b, out):
        x, y, z = as_lanes(a, width), as_lanes(b, width), as_lanes(out, width)
        for i in range(x.size):
            c, s = cos_sin(x[i])
            z[i, 0] = c
            z[i, 1] = s
            z[i, 2] = x[i] * y[i] + y[i] * c - 0.1 * x[i]
            z[i, 3] = reciprocal(y[i]) - s / y[i]
            z[i, 4] = larger(x[i], y[i])
            z[i, 5] = choose(x[i], 0.5, y[i], -1.0)
            z[i, 6] = square_root(y[i] * y[i])
            z[i, 7] = exponential(-y[i])
            z[i, 8] = -x[i] if any_less(0.0, y[i]) else x[i]

    return compute


ONE, MANY = _in_lanes(1), _in_lanes(LANES)
RANDOM = np.random.default_rng(0)
NUMBERS = np.concatenate([RANDOM.uniform(-0.8, 0.8, 40), RANDOM.uniform(-20, 20, 36), [0.0, -0.0, 1e6, np.pi / 4]])
OTHERS = RANDOM.uniform(0.1, 3.0, NUMBERS.size)


def _computed(compute, width, numbers):
    out = np.empty((numbers.size // width, 9, width))
    compute(numbers.reshape(-1, width).copy(), OTHERS.reshape(-1, width).copy(), out)
    return out.transpose(1, 0, 2).reshape(9, -1)


def test_the_bits_hang_neither_on_the_number_of_lanes_nor_on_what_is_in_the_others():
    alone = _computed(ONE, 1, NUMBERS)
    np.testing.assert_array_equal(alone.view(np.int64), _computed(MANY, LANES, NUMBERS).view(np.int64))
    rows = np.arange(NUMBERS.size) % LANES != 3
    np.testing.assert_array_equal(alone[:8, rows], _computed(MANY, LANES, np.where(rows, NUMBERS, np.nan))[:8, rows])


def test_functions_are_those_of_numpy():
    got, x, y = _computed(MANY, LANES, NUMBERS), NUMBERS, OTHERS
    np.testing.assert_allclose(got[:2], [np.cos(x), np.sin(x)], rtol=0, atol=3e-16)
    expected = [x * y + y * np.cos(x) - 0.1 * x, 1 / y - np.sin(x) / y, np.maximum(x, y), np.where(x < 0.5, y, -1)]
    np.testing.assert_allclose(got[2:], [*expected, y, np.exp(-y), -x], rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_angle_has_no_sine(bad):
    got = _computed(MANY, LANES, np.where(np.arange(NUMBERS.size) % LANES == 0, bad, NUMBERS))
    assert np.isnan(got[:2, ::LANES]).all()
    assert np.isfinite(got[:2].reshape(2, -1, LANES)[:, :, 1:]).all()


def test_debug_information_does_not_change_which_sums_are_fused(monkeypatch):
    def product_and_sum(numbers):
        lanes = as_lanes(numbers, LANES)
        product = lanes[0] * lanes[1]
        lanes[2] = product + lanes[2]

    monkeypatch.setattr("numba.config.DEBUGINFO_DEFAULT", 1)
    function = njit(cache=False)(product_and_sum)
    numbers = np.full((3, LANES), 1.0 + 2.0**-30)
    numbers[2] = -1.0 - 2.0**-29
    function(numbers)
    np.testing.assert_array_equal(numbers[2], 2.0**-60)


# One process has imported what takes long; every command is a child of it, with variables of its own. Of what `doctor`
# looks at, packages count here.
RUNS = """
import json, os, sys
import numba, numpy, pydantic, scipy.linalg, scipy.optimize, typer, xarray

for arguments, variables in json.loads(sys.argv[1]):
    if not (child := os.fork()):
        for number, name in enumerate(("out", "err"), 1):
            os.dup2(os.open(" ".join([*variables, name]), os.O_WRONLY | os.O_CREAT), number)
        os.environ.update(variables)
        numba.config.reload_config()
        from chilopod.cli import doctor, main
        doctor._LOOKS.clear()
        code = main(arguments)
        sys.stdout.flush()
        os._exit(code)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
WALK, DOCTOR = ["walk", "aoi2022-planar", "--duration", "0.1 s"], ["doctor", "--json"]
LAYER = "NUMBA_THREADING_LAYER"
ASKED = {
    "NUMBA_DISABLE_JIT": (["stability", "aoi2022-planar"], "1"),
    "NUMBA_CPU_NAME": (["stability", "aoi2022-planar"], "nosuch"),
    LAYER: (WALK, "tbb"),
    f"{LAYER}_PRIORITY": (DOCTOR, "zzz"),
}


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Exit code, stdout and stderr of a command where a variable is what it must not be."""
    if not hasattr(os, "fork"):
        pytest.skip("runs are forked")
    folder = tmp_path_factory.mktemp("runs")
    asked = json.dumps([(arguments, {name: value}) for name, (arguments, value) in ASKED.items()])
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    runs = [sys.executable, "-c", RUNS, asked]
    codes = subprocess.run(runs, cwd=folder, env=environment, stdout=subprocess.PIPE, timeout=120, check=True).stdout
    return {
        name: (int(code), *((folder / f"{name} {stream}").read_text() for stream in ("out", "err")))
        for name, code in zip(ASKED, codes.split(), strict=True)
    }


def _errors(stderr):
    """Lines of it but those by which the command of a loaded machine says first what it does."""
    return [each for each in stderr.splitlines() if not each.startswith(("stability: ", "walk: "))]


@pytest.mark.parametrize(("name", "shown"), [("DISABLE_JIT", "1"), ("CPU_NAME", "'nosuch'")])
def test_code_that_cannot_be_compiled_is_refused_in_one_line(done, name, shown):
    code, _, stderr = done[f"NUMBA_{name}"]
    assert code == 2
    (error,) = _errors(stderr)
    assert error.startswith(f"error: NUMBA_{name} = {shown}: ")


def test_threads_that_cannot_be_had_are_one_line(done):
    if find_library("tbb"):
        pytest.skip("they can be had")
    code, _, stderr = done[LAYER]
    assert code == 2
    (error,) = _errors(stderr)
    assert error.startswith(f"error: {LAYER} = 'tbb': cannot be loaded; allowed: ")


def test_the_doctor_says_which_variable_of_threads_to_unset(done):
    code, stdout, _ = done[f"{LAYER}_PRIORITY"]
    assert code == 3
    (found,) = [each for each in json.loads(stdout)["findings"] if each["mend"] and each["name"] == "numba"]
    assert f"{LAYER}_PRIORITY = 'zzz': cannot be loaded; allowed: " in found["found"]
    assert found["mend"] == f"unset {LAYER}_PRIORITY"


@pytest.mark.parametrize(("chosen", "policy"), [(None, "passive"), ("active", "active")])
def test_threads_that_wait_sleep_unless_the_user_says_otherwise(monkeypatch, chosen, policy):
    monkeypatch.setenv("OMP_WAIT_POLICY", chosen or "")
    if chosen is None:
        monkeypatch.delenv("OMP_WAIT_POLICY")
    runpy.run_path(compiled.__file__)
    assert os.environ["OMP_WAIT_POLICY"] == policy
