"""Numbers in lanes: the same bits in any number of lanes and beside any others, and the functions of them."""

import json
import os
import subprocess
import sys
from ctypes.util import find_library

import numpy as np
import pytest

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
    compiled = njit(cache=False)(product_and_sum)
    numbers = np.full((3, LANES), 1.0 + 2.0**-30)
    numbers[2] = -1.0 - 2.0**-29
    compiled(numbers)
    np.testing.assert_array_equal(numbers[2], 2.0**-60)


def _python(code, **variables):
    kept = {name: value for name, value in os.environ.items() if name != "OMP_WAIT_POLICY"}
    command = [sys.executable, "-c", code]
    return subprocess.run(command, env={**kept, **variables}, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize(("name", "value", "shown"), [("DISABLE_JIT", "1", "1"), ("CPU_NAME", "nosuch", "'nosuch'")])
def test_code_that_cannot_be_compiled_is_refused_in_one_line(name, value, shown):
    code = "from chilopod.cli import main; raise SystemExit(main(['stability', 'aoi2022-planar']))"
    done = _python(code, **{f"NUMBA_{name}": value})
    assert done.returncode == 2
    (error,) = [each for each in done.stderr.splitlines() if not each.startswith("stability: ")]  # of a loaded machine
    assert error.startswith(f"error: NUMBA_{name} = {shown}: ")


@pytest.mark.parametrize(
    ("command", "name", "value"),
    [("['walk', 'aoi2022-planar', '--duration', '0.1 s']", "", "tbb"), ("['doctor', '--json']", "_PRIORITY", "zzz")],
)
def test_threads_that_cannot_be_had_are_one_line(command, name, value):
    if value == "tbb" and find_library("tbb"):
        pytest.skip("they can be had")
    wish = {f"NUMBA_THREADING_LAYER{name}": value}
    done = _python(f"from chilopod.cli import main; raise SystemExit(main({command}))", **wish)
    line = f"NUMBA_THREADING_LAYER{name} = '{value}': cannot be loaded; allowed: "
    if "doctor" in command:
        assert done.returncode == 3
        (found,) = [each for each in json.loads(done.stdout)["findings"] if each["mend"] and each["name"] == "numba"]
        assert line in found["found"]
        assert found["mend"] == f"unset NUMBA_THREADING_LAYER{name}"
    else:
        assert done.returncode == 2
        # A loaded machine takes so long that it says first what it does.
        (error,) = [each for each in done.stderr.splitlines() if not each.startswith("walk: ")]
        assert error.startswith(f"error: {line}")


def test_threads_that_wait_sleep_unless_the_user_says_otherwise():
    code = "import chilopod.compiled, os; print(os.environ['OMP_WAIT_POLICY'])"
    assert _python(code).stdout == "passive\n"
    assert _python(code, OMP_WAIT_POLICY="active").stdout == "active\n"
