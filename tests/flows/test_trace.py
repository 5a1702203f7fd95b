"""Tracing right-hand sides: what is taken, what is refused, and what is done once for a family."""

import functools
import math
import types
from math import comb, cos, exp, expm1, fabs, floor
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from chilopod.flows.tracing.bernoulli import bernoulli
from chilopod.flows.tracing.trace import evaluate, evaluate_jacobian, trace
from chilopod.flows.tracing.traced import REPLACED, Untraceable
from chilopod.stability import from_rhs

STIFFNESS = 1.7
MATRIX = np.array([[0.0, 1.0, 0.5], [-1.0, 0.0, 0.2], [0.3, 0.1, -0.4]])


@numba.njit
def spring(x, k):
    return k * x**3


@numba.njit
def compiled(t, x, force):
    out = np.zeros(2)
    out[0] = x[1]
    out[1] = -STIFFNESS * x[0] - spring(x[0], 0.5) + force * np.cos(t)
    return out


def mass_matrix(t, x, ratio):
    c = math.cos(x[0] - x[1])
    mass = np.array([[2.0, ratio * c], [ratio * c, 1.0 + 0.1 * x[2] ** 2]])
    acceleration = np.linalg.solve(mass, np.array([-x[0], -math.sin(x[1])]))
    return np.concatenate([x[2:], acceleration])


def constants_in_a_loop(t, x, n, p):
    if p > 0:
        return [sum(x[0] ** i for i in range(n)) * p]
    return [-x[0]]


def imports_inside(t, x):
    import numpy as np

    return np.where(x > 0, np.tanh(x), 0.5 * x) + (t % 2.0 > 0.7) * np.sign(np.cos(t))


def writes_slices(t, x, k):
    out = np.empty_like(x)
    out[:-1] = x[1:]
    out[-1] = -k[0] * x[0] - np.sum(k[1:] * x[1:])
    out += 0.1 * t
    return out


class Oscillator:
    stiffness = 2.0

    def rhs(self, t, x):
        return np.array([x[1], -self.stiffness * x[0]])

    def __call__(self, t, x):
        return self.rhs(t, x)


TAKEN = {
    "compiled, with helper and global": (compiled, 2, (0.3,)),
    "mass matrix": (mass_matrix, 4, (0.5,)),
    "loop and branch over constants": (constants_in_a_loop, 1, (3, 0.5)),
    "the other branch": (constants_in_a_loop, 1, (3, -0.5)),
    "import inside": (imports_inside, 2, ()),
    "slices": (writes_slices, 3, (np.array([1.0, 2.0, 3.0]),)),
    "method": (Oscillator().rhs, 2, ()),
    "object": (Oscillator(), 2, ()),
    "partial": (functools.partial(constants_in_a_loop, n=2, p=0.7), 1, ()),
    "default": (lambda t, x, k=2.0: -k * x, 3, ()),
    "matrix": (lambda t, x: MATRIX @ x - x.T * (x @ x), 3, ()),
    "inverse matrix": (lambda t, x, m: np.linalg.inv(m) @ x, 3, (MATRIX,)),
    "ring": (lambda t, x: np.roll(x, 1) - 2 * x + np.roll(x, -1) + np.diff(np.append(x, x[0])), 5, ()),
    "list arithmetic": (lambda t, x: [x[1] / (1 + x[0] ** 2), -(x[0] ** -2) + 2.0 ** x[1]], 2, ()),
    "powers": (lambda t, x, c: np.abs(x) ** c - x**7 + np.sqrt(np.square(x) + 1) ** 1.5, 2, (1.3,)),
    "builtins": (lambda t, x: [max(x[0], 0.1, x[1]) - min(x), abs(x[1]) + float(x[0]) + pow(x[1], 2)], 2, ()),
    "math": (lambda t, x: [math.hypot(*x) - math.atan2(x[0], x[1]), floor(3 * x[0]) + fabs(x[1]) + cos(t)], 2, ()),
    "clip, norm, mean": (lambda t, x: np.clip(x, -0.5, 0.5) + np.linalg.norm(x) - x.mean() + np.max(x), 3, ()),
    "comparison with oneself": (lambda t, x: np.where((x < x) | (x >= 2 * x - x), x, 2 * x), 2, ()),
    "pairs": (lambda t, x: np.add.reduce(np.where(x[:, None] < x[None, :], 1.0, 0.0), axis=1) - x, 3, ()),
    "kept axes": (
        lambda t, x: np.add.reduce(
            np.outer(x, x) / np.linalg.norm(np.outer(x, x + 1.0), axis=1, keepdims=True)
            - np.mean(np.outer(x, x), axis=1, keepdims=True)
            + np.max(np.outer(x, x), axis=1, keepdims=True),
            axis=0,
        ),
        3,
        (),
    ),
    "sign of a number": (lambda t, x: np.copysign(x, 0.0) + np.copysign(x, -2.0 * x) + np.copysign(x[0], -1.0), 2, ()),
    "both conditions": (lambda t, x: np.where((x[0] > 0) & ~(x[1] < 0.2), 1.0, x), 2, ()),
    "complex step habits": (lambda t, x: [np.sign(x[1].real) - np.real(x[0]), x.imag[0] + x[0]], 2, ()),
    "arrays of states": (lambda t, x: (x.reshape(2, 2) @ np.array([[0.0, 1.0], [-1.0, 0.2]])).ravel(), 4, ()),
    "floor and remainder": (lambda t, x: [np.floor(2 * x[0]) + t % 1.0, np.ceil(x[1]) + x[0] // 0.3], 2, ()),
    "large arguments": (
        lambda t, x, k=1.1e9, b=0.3: [np.sin(k * (x[0] + b * x[1] - 0.7 * x[0]) / 0.9) + t, x[0]],
        2,
        (),
    ),
    "all functions": (
        lambda t, x: [
            np.exp(-x[0]) + np.sinh(x[0]) * np.cosh(x[0]) + np.tan(0.3 * np.tanh(x[0])),
            np.arctan(x[0]) + np.arcsin(np.tanh(x[1])) + np.arccos(0.5 * np.tanh(x[1])) + np.log(2 + np.cos(x[0])),
        ],
        2,
        (),
    ),
}


@pytest.mark.parametrize("case", TAKEN)
def test_the_tape_is_the_function(case):
    """Values at other states than the trace was verified at, and the derivative against central differences."""
    rhs, n, args = TAKEN[case]
    traced = trace(rhs, n, args)
    rng = np.random.default_rng(5)
    for _ in range(6):
        t, x = rng.uniform(0, 3), rng.uniform(0.15, 0.9, n) * rng.choice([-1.0, 1.0], n)
        value, jacobian = evaluate_jacobian(traced.tape, t, x, traced.params)
        exactness = 1e-6 if case == "large arguments" else 1e-13
        np.testing.assert_allclose(value, np.asarray(rhs(t, x, *args), dtype=float), rtol=exactness, atol=exactness)
        if case == "large arguments":
            continue  # no differences
        h = 1e-6
        for j in range(n):
            step = h * np.eye(n)[j]
            up, down = (np.asarray(rhs(t, x + s * step, *args), dtype=float) for s in (1, -1))
            np.testing.assert_allclose(jacobian[:, j], (up - down) / (2 * h), rtol=1e-6, atol=1e-7)


def branches(t, x):
    return [x[1], -x[0] if x[0] > 0 else 0.0]


def remembers():
    calls = []

    def rhs(t, x):
        calls.append(t)
        return -x * len(calls)

    return rhs


def swallows(t, x):
    try:
        return -x if x[0] > 0 else x
    except Exception:
        return -x


REFUSED = {
    "a branch": (branches, 2, ()),
    "an index": (lambda t, x: [np.array([1.0, 2.0])[int(x[0])]], 1, ()),
    "an interpolation": (lambda t, x: [np.interp(x[0], [0.0, 1.0], [0.0, 1.0])], 1, ()),
    "memory": (remembers(), 2, ()),
    "chance": (lambda t, x: -x * np.random.default_rng().random(), 2, ()),
    "a swallowed refusal": (swallows, 2, ()),
    "the wrong shape": (lambda t, x: x, 1, (2.0,)),
    "nothing": (lambda t, x: None, 1, ()),
    "an error": (lambda t, x: 1 / 0, 1, ()),
    "complex": (lambda t, x: 1j * x, 1, ()),
    "a mask": (lambda t, x: x[x > 0], 2, ()),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_traced_is_said_so(case):
    rhs, n, args = REFUSED[case]
    with pytest.raises(Untraceable, match=r"\w"):
        trace(rhs, n, args)


def test_an_operation_that_is_recorded_wrongly_is_said_so(monkeypatch):
    monkeypatch.setitem(REPLACED, np.clip, lambda value, *_: value)

    def reset(t, x):
        return [x.clip(-0.1, 0.1)[0], x[1]]

    with pytest.raises(Untraceable, match="recorded with other values than numpy's"):
        trace(lambda t, x: x.clip(-0.1, 0.1), 2)
    with pytest.raises(Untraceable, match="recorded with other values than numpy's"):
        trace(lambda t, x: -x, 2, events=[(lambda t, x: x.clip(-0.1, 0.1)[0] - 0.05, None)])
    with pytest.raises(Untraceable, match="recorded with other values than numpy's"):
        trace(lambda t, x: -x, 2, events=[(lambda t, x: x[0], reset)])


def test_a_reset_with_memory_is_refused():
    speeds = []

    def reset(t, x):
        speeds.append(x[1])
        return [x[0], -x[1] * len(speeds)]

    with pytest.raises(Untraceable, match="memory or random numbers"):
        trace(lambda t, x: -x, 2, events=[(lambda t, x: x[0], reset)])


def test_a_family_is_traced_once():
    def family(p, q):
        return lambda t, x, r=q: [x[1], -p * x[0] + r]

    first, again = trace(family(1.0, 2.0), 2), trace(family(3.0, 4.0), 2)
    assert again.tape is first.tape
    assert sorted(again.params) == [3.0, 4.0]
    assert evaluate(again.tape, again.tape.slopes, 0.0, np.array([1.0, 0.0]), again.params).tolist() == [0.0, 1.0]


def test_whole_powers_are_smooth_at_zero_whatever_gives_the_exponent():
    def hill(t, x, n, b):
        return [b / (1.0 + x[0] ** n) + x[0] ** (n - 1)]

    for n, b in ((4.0, 2.0), (4.0, 3.0), (2.5, 3.0), (np.float64(4.0), 2.0)):
        traced = trace(hill, 1, (n, b))
        value, slope = evaluate_jacobian(traced.tape, 0.0, np.array([1.5]), traced.params)
        assert value[0] == pytest.approx(b / (1.0 + 1.5**n) + 1.5 ** (n - 1), rel=1e-14)
        assert slope[0, 0] == pytest.approx((n - 1) * 1.5 ** (n - 2) - b * n * 1.5 ** (n - 1) / (1 + 1.5**n) ** 2)
    assert trace(hill, 1, (4.0, 3.0)).tape is trace(hill, 1, (4.0, 2.0)).tape  # once for all other numbers
    assert trace(hill, 1, (2.5, 3.0)).tape is not traced.tape
    value, slope = evaluate_jacobian(traced.tape, 0.0, np.zeros(1), traced.params)
    assert (value[0], slope[0, 0]) == (2.0, 0.0)


@pytest.mark.parametrize("kind", [float, np.float64, "float64"])
def test_arrays_of_floats_are_made_by_any_name_of_their_type(kind):
    def rhs(t, x):
        out = np.array([0, 1], dtype=kind)
        out[0] += x[0]
        return out + np.zeros(2, kind) + np.asarray(x, dtype=kind) + np.zeros_like(x, dtype=kind)

    traced = trace(rhs, 2)
    assert evaluate(traced.tape, traced.tape.slopes, 0.0, np.array([3.0, 5.0]), traced.params).tolist() == [6.0, 6.0]


def test_changed_globals_and_whole_numbers_are_seen():
    box = {"k": 1.0, "n": 2}
    code = compile("def rhs(t, x): return [-k * x[0] ** n]", "<test>", "exec")
    exec(code, box)
    box["rhs"].__module__ = __name__
    values = []
    for box["k"], box["n"] in ((1.0, 2), (5.0, 2), (5.0, 3)):
        traced = trace(box["rhs"], 1)
        values.append(evaluate(traced.tape, traced.tape.slopes, 0.0, np.array([2.0]), traced.params)[0])
    assert values == [-4.0, -20.0, -40.0]


def test_objects_that_may_change_are_read_anew():
    box = SimpleNamespace(k=1.0)

    def rhs(t, x):
        return -box.k * x

    values = []
    for box.k in (1.0, 3.0):
        traced = trace(rhs, 1)
        values.append(evaluate(traced.tape, traced.tape.slopes, 0.0, np.array([2.0]), traced.params)[0])
    assert values == [-2.0, -6.0]


@given(st.data())
def test_random_expressions(data):
    """Expression trees over two states, time and a parameter."""
    functions = [np.sin, np.cos, np.tanh, np.arctan, np.abs, np.sign, np.floor, np.square, lambda v: np.exp(-(v * v))]

    def tree(depth):
        if depth == 0:
            leaf = data.draw(st.sampled_from(["x0", "x1", "t", "p", "number"]))
            number = data.draw(st.floats(-3, 3).filter(lambda v: abs(v) > 0.01))
            return {
                "x0": lambda t, x, p: x[0], "x1": lambda t, x, p: x[1], "t": lambda t, x, p: t,
                "p": lambda t, x, p: p, "number": lambda t, x, p: number,
            }[leaf]  # fmt: skip
        a, b = tree(depth - 1), tree(depth - 1)
        kind = data.draw(st.sampled_from(["+", "-", "*", "/", "max", "f"]))
        f = data.draw(st.sampled_from(functions))
        return {
            "+": lambda t, x, p: a(t, x, p) + b(t, x, p),
            "-": lambda t, x, p: a(t, x, p) - b(t, x, p),
            "*": lambda t, x, p: a(t, x, p) * b(t, x, p),
            "/": lambda t, x, p: a(t, x, p) / (1.5 + np.cos(b(t, x, p))),
            "max": lambda t, x, p: np.maximum(a(t, x, p), b(t, x, p)),
            "f": lambda t, x, p: f(a(t, x, p)),
        }[kind]

    one, other = tree(3), tree(3)

    def rhs(t, x, p):
        return [one(t, x, p), other(t, x, p)]

    try:
        traced = trace(rhs, 2, (0.37,))
    except Untraceable:  # the sign of what is zero but for round-off: no two ways to compute it agree
        assume(False)
    x = np.array([0.613, -1.371])
    np.testing.assert_allclose(
        evaluate(traced.tape, traced.tape.slopes, 0.517, x, traced.params),
        np.array(rhs(0.517, x, 0.37), dtype=float),
        rtol=1e-10,
        atol=1e-10,
    )


def test_functions_without_a_module():
    """Such as those of code that was executed from a string."""
    names = {}
    exec("def double(x):\n    return 2.0 * x\n\ndef rhs(t, x):\n    return [double(x[0])]\n", names)
    traced = trace(names["rhs"], 1)
    assert evaluate(traced.tape, traced.tape.slopes, np.zeros(1), np.full((1, 1), 3.0), traced.params).max() == 6.0


class _Holder:
    rate = 1.0


_MODULE = types.ModuleType("a_module_of_a_user")
_TABLE = {"rate": 1.0}
_GET = _TABLE.get
_UFUNC = np.frompyfunc(lambda x: -_TABLE["rate"] * x, 1, 1)
_VECTORISED = np.vectorize(lambda x: -_TABLE["rate"] * x, otypes=[object])


def _set_rate(value):
    _Holder.rate = _MODULE.rate = _TABLE["rate"] = value


@pytest.mark.parametrize(
    "rhs",
    [
        lambda t, x: [-_Holder.rate * x[0]],
        lambda t, x: [-_MODULE.rate * x[0]],
        lambda t, x: [-_GET("rate") * x[0]],
        lambda t, x: [_UFUNC(x[0])],
        lambda t, x: [_VECTORISED(x[0])],
    ],
    ids=["class", "module", "bound method", "ufunc", "vectorised"],
)
def test_what_a_function_reads_through_an_object_is_read_anew(rhs):
    for rate in (1.0, 2.0):
        _set_rate(rate)
        assert from_rhs(rhs, 1, 1.0).flow(np.ones(1), 0.0, 1.0)[1].item() == pytest.approx(np.exp(-rate), rel=1e-13)


@pytest.mark.parametrize("polynomial", [lambda k: np.poly1d([-k, 0.0]), lambda k: np.polynomial.Polynomial([0.0, -k])])
def test_an_object_at_the_place_of_an_earlier_one_is_another(polynomial):
    for rate in (1.0, 2.0):
        found = polynomial(rate)
        flow = from_rhs(lambda t, x, f=found: [f(x[0])], 1, 1.0).flow
        del found
        assert flow(np.ones(1), 0.0, 1.0)[1].item() == pytest.approx(np.exp(-rate), rel=1e-13)


@pytest.mark.parametrize("u", [-700.0, -5.0, -2.1, -1.9, -1e-9, 0.3, 1.99, 2.01, 6.0, 40.0])
def test_derivatives_of_the_bernoulli_function(u):
    """Derivatives of u = (exp(u) - 1) b(u), by Leibniz's rule: from the second on
    b^(n) (exp(u) - 1) + sum over k < n of C(n, k) b^(k) exp(u) = 0."""
    b = [bernoulli(u, n) for n in range(13)]
    scale = exp(-max(u, 0.0))
    assert b[0] * expm1(u) * scale == pytest.approx(u * scale, rel=1e-14)
    for n in range(1, 13):
        parts = [b[n] * expm1(u) * scale, *(comb(n, k) * b[k] * exp(u) * scale for k in range(n))]
        assert sum(parts) == pytest.approx(scale * (n == 1), abs=1e-9 * max(map(abs, parts)))
