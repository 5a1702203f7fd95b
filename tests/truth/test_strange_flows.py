"""Roessler's and Lorenz's flow: orbits and bifurcations that are known to many digits, but not in closed form.

Digits are those of a Taylor integration in extended precision (64 bits of mantissa) with the tangent flow, Newton's
method for state, period and parameter, and multipliers from trace and determinant (Liouville).
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chilopod.errors import AnalysisError
from chilopod.stability import Criticality, Kind, find_orbit, locate, multipliers
from helpers.systems import lorenz, roessler

# c and period of the first two period doublings, a = b = 0.2
DOUBLINGS = [(2.832445027862538915, 5.7698200165065631905), (3.8373581684100937586, 11.572688804465817831)]
# r = 24: x = y, z, period and multipliers of the orbit round one of the equilibria
LORENZ = (10.1211773312145627635, 25.737222654445643883, 0.67933676419821826034)
LORENZ_MULTIPLIERS = (1.0320882978304110895, 8.9986280870868011905e-05)
HOPF = 470.0 / 19.0  # sigma (sigma + b + 3) / (sigma - b - 1)


@pytest.mark.parametrize("units", [(1.0, 1.0, 1.0), (1e9, 1e-9, 1e3)])
def test_first_period_doubling(units):
    found = locate(lambda c: roessler(c, units=units), (2.5, 3.2), orbit=np.array([3.0, 0.0, 0.1]) * units)
    assert found.complete
    (point,) = found
    assert point.kind is Kind.PERIOD_DOUBLING
    assert abs(point.value - DOUBLINGS[0][0]) <= point.error_bound < 1e-10
    assert point.period == pytest.approx(DOUBLINGS[0][1], rel=1e-11)
    assert point.criticality is Criticality.SUPERCRITICAL


def test_second_period_doubling():
    start = find_orbit(roessler(3.2, 11.6), [4.2, 0.0, 0.1])
    assert start.period > 10.0
    (point,) = locate(lambda c: roessler(c, 11.6), (3.2, 4.2), orbit=start.state)
    assert point.kind is Kind.PERIOD_DOUBLING
    assert abs(point.value - DOUBLINGS[1][0]) <= point.error_bound < 1e-9
    assert point.period == pytest.approx(DOUBLINGS[1][1], rel=1e-9)
    assert point.criticality is Criticality.SUPERCRITICAL


def test_one_orbit_from_its_birth_far_into_chaos():
    """The orbit of period one doubles once only, however chaotic the motion around it is."""
    (point,) = locate(roessler, (0.6, 8.0), orbit=[0.9, 0.0, 0.1], normal_form=False)
    assert abs(point.value - DOUBLINGS[0][0]) <= point.error_bound < 1e-9


@pytest.mark.parametrize("c", [2.83, 2.835])
def test_the_sign_of_the_multiplier_by_scipy(c):
    """The multiplier passes -1 between these two, by another integrator."""
    found = find_orbit(roessler(c), [3.0, 0.0, 0.1])

    def with_tangent(t, y):
        x, tangent = y[:3], y[3:].reshape(3, 3)
        jacobian = np.array([[0.0, -1.0, -1.0], [1.0, 0.2, 0.0], [x[2], 0.0, x[0] - c]])
        return np.append([-x[1] - x[2], x[0] + 0.2 * x[1], 0.2 + x[2] * (x[0] - c)], jacobian @ tangent)

    start = np.append(found.state, np.eye(3))
    end = solve_ivp(with_tangent, (0.0, found.period), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(end[:3], found.state, atol=1e-9)
    # 1, the critical one, and one that is almost zero.
    by_scipy = np.trace(end[3:].reshape(3, 3)) - 1.0
    assert multipliers(roessler(c), found.state).values.sum() == pytest.approx(by_scipy, abs=1e-8)
    assert (by_scipy < -1.0) == (c > DOUBLINGS[0][0])


@pytest.mark.parametrize("off", [0.5, 1.0, 2.5, 4.0])
def test_the_orbit_born_at_the_subcritical_hopf_point(off):
    """It is a saddle, so that nothing settles on it, and a guess off its stable manifold does not return to where it
    started either."""
    q = np.sqrt(8.0 / 3.0 * 23.0)
    found = multipliers(lorenz(24.0, 0.66), [q + off, q + off, 23.0 + off])
    assert found.period == pytest.approx(LORENZ[2], rel=1e-12)
    assert np.abs(found.values - LORENZ_MULTIPLIERS).max() <= found.error_bound < 1e-10
    assert not found.stable


def test_up_to_its_birth_and_down_to_the_homoclinic_orbit():
    up = locate(lorenz, (24.0, 25.5), orbit=[LORENZ[0], LORENZ[0], LORENZ[1]])
    assert len(up) == 0
    assert not up.complete
    assert "shrinks into an equilibrium" in up.remarks[0]
    assert float(up.remarks[0].split("near ")[1].split(":")[0]) == pytest.approx(HOPF, abs=2e-3)
    down = locate(lambda minus_r: lorenz(-minus_r), (-24.0, -13.5), orbit=[LORENZ[0], LORENZ[0], LORENZ[1]])
    assert len(down) == 0
    assert not down.complete
    # The period grows without bound at r = 13.926...
    assert float(down.remarks[0].split("beyond ")[1]) == pytest.approx(-13.926, abs=0.1)


def test_an_equilibrium_of_lorenz():
    with pytest.raises(AnalysisError, match=r"^orbit: [^\n]*$"):
        multipliers(lorenz(20.0), [0.0, 0.0, 0.0])
