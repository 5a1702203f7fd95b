"""Random maps whose normal forms are known: the errors hold, in any units, with any noise, and are not much too large.

A map in its normal form on the critical space, with contracting states beside it, seen through polynomial shears whose
inverses are polynomials too, a linear map, and units that differ by up to 1e18.
"""

import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest

from chilopod.stability.normal_forms.manifold import CriticalOrbit
from chilopod.stability.normal_forms.normal_form import NormalFormStatus, normal_form, quintic
from chilopod.stability.returns import ReturnMap

CASES = 60
SHEARS = 3


@dataclass(frozen=True)
class Shears:
    """u_i += quadratic and cubic terms of the other entries, one i after another."""

    entries: list
    quadratic: list
    cubic: list

    def __call__(self, u):
        u = u.copy()
        for i, matrix, vector in zip(self.entries, self.quadratic, self.cubic, strict=True):
            u[:, i] += np.einsum("kj,kl,jl->k", u, u, matrix) + u**3 @ vector
        return u

    def undone(self, u):
        u = u.copy()
        for i, matrix, vector in reversed(list(zip(self.entries, self.quadratic, self.cubic, strict=True))):
            u[:, i] -= np.einsum("kj,kl,jl->k", u, u, matrix) + u**3 @ vector
        return u


def shears(random, n):
    entries, quadratic, cubic = [], [], []
    for _ in range(SHEARS):
        i = random.integers(n)
        others = np.arange(n) != i
        entries.append(i)
        quadratic.append(random.normal(size=(n, n)) * random.uniform(0, 0.5) * np.outer(others, others))
        cubic.append(0.3 * random.normal(size=n) * others)
    return Shears(entries, quadratic, cubic)


def on_critical_space(kind, b, c, e, angle):
    """The map of the critical coordinates, shape (k, 1 or 2)."""
    if kind == "pair":

        def turned(u):
            z = u[:, 0] + 1j * u[:, 1]
            square = np.abs(z) ** 2
            image = np.exp(1j * angle) * z * (1.0 + c * square + e * square**2)
            return np.stack([image.real, image.imag], axis=1)

        return turned
    if kind == "saturating":  # singular at a complex amplitude, as the maps of flows are
        return lambda a: a / np.sqrt(1.0 - 2.0 * c.real * a**2)
    sign = -1.0 if kind == "flip" else 1.0
    return lambda a: sign * a + b * a**2 + c.real * a**3 + e.real * a**5


def random_map(kind, random):
    """A map, its critical orbit, and its coefficients of second, third and fifth order for one return."""
    critical = 2 if kind == "pair" else 1
    n = int(random.integers(critical, 6))
    b, c, e = random.normal(), complex(*random.normal(size=2)), complex(*random.normal(size=2))
    b = b if kind == "fold" else 0.0
    angle = random.choice([random.uniform(0.1, 1.45), random.uniform(1.7, 1.99), random.uniform(2.2, 3.0)])
    core = on_critical_space(kind, b, c, e, angle)
    inner = random.normal(size=(n - critical, n - critical))
    if inner.size:
        inner *= random.uniform(0.05, 0.8) / np.abs(np.linalg.eigvals(inner)).max()
    linear = np.zeros((n, n))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    multiplier = {"pair": np.exp(1j * angle), "flip": -1.0 + 0j}.get(kind, 1.0 + 0j)
    linear[:critical, :critical] = turn if kind == "pair" else multiplier.real
    linear[critical:, critical:] = inner
    mode, dual = np.zeros(n, dtype=complex), np.zeros(n, dtype=complex)
    mode[:critical], dual[:critical] = ([1, -1j], [0.5, -0.5j]) if kind == "pair" else (1.0, 1.0)

    bend = shears(random, n)
    left, right = (np.linalg.qr(random.normal(size=(n, n)))[0] for _ in range(2))
    basis = left @ np.diag(np.exp(random.uniform(-1.5, 1.5, n))) @ right
    inverse = np.linalg.inv(basis)
    units = 10.0 ** random.uniform(-9, 9) * 10.0 ** (random.uniform(-9, 9, n) * random.integers(2))
    orbit = random.normal(size=n) * random.integers(2)
    noise = 10.0 ** random.uniform(-15, -10) * random.integers(2)

    def mapped(states):
        u = bend.undone((states / units - orbit) @ inverse.T)
        grown = 1.0 + 0.3 * (u[:, :critical] ** 2).sum(axis=1, keepdims=True)
        image = np.hstack([core(u[:, :critical]), u[:, critical:] @ inner.T * grown])
        y = bend(image) @ basis.T
        y = y + noise * (np.abs(y) + np.abs(orbit)) * random.uniform(-1, 1, y.shape)
        return (y + orbit) * units

    right, left = units * (basis @ mode), inverse.T @ dual / units
    length = np.linalg.norm(right)
    jacobian = units[:, None] * (basis @ linear @ inverse) / units
    image = ReturnMap(orbit * units, jacobian, 0.0, 1, 1.0)
    at = CriticalOrbit(orbit * units, image, multiplier, right / length, left * length)
    per_amplitude = (2.0 if kind == "pair" else 1.0) / length
    return mapped, at, b * per_amplitude, c * per_amplitude**2, e * per_amplitude**4


@pytest.mark.parametrize("kind", ["flip", "fold", "saturating", "pair"])
def test_errors_hold(kind):
    found = 0
    used = []  # share of the bound that the true error has
    for case in range(CASES):
        mapped, at, quadratic, cubic, _ = random_map(kind, np.random.default_rng([7, case]))
        form = normal_form(mapped, at, orbit_error=0.0)
        if form.status is not NormalFormStatus.FOUND:
            continue
        found += 1
        pairs = [(form.cubic, form.cubic_error, (-2.0 if kind == "flip" else 1.0) * cubic.real)]
        if kind == "pair":
            pairs.append((form.rotation, form.rotation_error, cubic.imag))
        else:
            pairs.append((form.quadratic, form.quadratic_error, quadratic))
        for value, error, expected in pairs:
            assert abs(value - expected) <= error, (case, value, error, expected)
            if error > 0.0:
                used.append(abs(value - expected) / error)
    assert found >= 0.95 * CASES
    assert np.median(used) > 1e-3


@pytest.mark.parametrize("kind", ["flip", "fold", "pair"])
def test_errors_of_fifth_order_hold(kind, monkeypatch):
    """Where the cubic coefficient is zero; at a fold where the quadratic one is, too."""
    core = on_critical_space
    monkeypatch.setattr(
        sys.modules[__name__], "on_critical_space", lambda kind, b, c, *rest: core(kind, 0, 1j * c.imag, *rest)
    )
    used = []
    for case in range(CASES // 3):
        random = np.random.default_rng([8, case])
        mapped, at, _, cubic, fifth = random_map(kind, random)
        at = replace(at, image=replace(at.image, returns=int(random.integers(1, 4))))
        form = normal_form(mapped, at, orbit_error=0.0)
        if form.status is not NormalFormStatus.FOUND:
            continue
        found = quintic(mapped, at, form.amplitude)
        once = {"flip": -2.0 * fifth.real, "fold": fifth.real, "pair": fifth.real + 0.5 * cubic.imag**2}[kind]
        times = at.image.returns // 2 if kind == "flip" and at.image.returns == 2 else at.image.returns
        assert abs(found.coefficient - times * once) <= found.error, case
        used.append(abs(found.coefficient - times * once) / found.error)
    assert len(used) >= 0.3 * CASES
    assert np.median(used) > 1e-4
