"""Systems that several tests ask about, and the forms in which many others are given."""

import numpy as np

from chilopod.stability import PeriodicSystem, from_rhs


def linear(matrix, dimension, period=1.0, **more):
    """A system that moves x(t0) to ``matrix(t0, t1)`` x(t0); zero is its known orbit."""

    def flow(x, t0, t1):
        moves = matrix(t0, t1)
        return moves @ x, moves

    return PeriodicSystem(dimension, period, flow, **{"orbit": np.zeros(dimension), **more})


def of_map(image, dimension=1, error=1e-15, share=None, many=False, **more):
    """A system with a period of 1 whose return map is ``image(x)`` -> (H(x), H'(x)).

    Its derivatives are known to an error, or to a share of them; ``many`` gives it a flow of many states.
    """

    def flow(x, t0, t1):
        derivative = np.eye(dimension)
        for _ in range(round(t1 - t0)):
            x, slope = image(x)
            derivative = slope @ derivative
        return x, derivative

    def flow_with_error(x, t0, t1):
        state, derivative = flow(x, t0, t1)
        return state, derivative, error if share is None else share * np.abs(derivative)

    if many:
        more["flow_states"] = lambda states, t0, t1: np.array([flow(x, t0, t1)[0] for x in states])
    return PeriodicSystem(dimension, 1.0, flow, flow_with_error=flow_with_error, **more)


def henon(a, b):
    """(x, y) -> (1 - a x^2 + y, b x)."""
    return of_map(lambda x: (np.array([1.0 - a * x[0] ** 2 + x[1], b * x[0]]), [[-2.0 * a * x[0], 1.0], [b, 0.0]]), 2)


def doubling(fifth=0.0, **more):
    """x -> -(1 + p) x + (q - 0.1) x^3 + fifth x^5, whose period doubling turns at q = 0.1, as a family of p and q."""

    def family2(p, q):
        def image(x):
            slope = -(1.0 + p) + 3.0 * (q - 0.1) * x**2 + 5.0 * fifth * x**4
            return -(1.0 + p) * x + (q - 0.1) * x**3 + fifth * x**5, np.array([slope])

        return of_map(image, error=4e-15, orbit=np.zeros(1), **more)

    return family2


def duffing(force=2.5, symmetry=None):
    """x'' + 0.2 x' + x^3 = force cos t."""

    def rhs(t, x, force):
        return [x[1], -0.2 * x[1] - x[0] ** 3 + force * np.cos(t)]

    return from_rhs(rhs, 2, 2.0 * np.pi, args=(force,), symmetry=symmetry)


def van_der_pol(t, x, mu, a=1.0, b=1.0):
    u, v = x[0] / a, x[1] / b
    return [v * a, (mu * (1.0 - u * u) * v - u) * b]


def lorenz_rhs(t, x, r):
    return [10.0 * (x[1] - x[0]), r * x[0] - x[1] - x[0] * x[2], x[0] * x[1] - 8.0 / 3.0 * x[2]]


def lorenz(r, guess_period=0.67, **more):
    return from_rhs(lorenz_rhs, 3, None, args=(r,), guess_period=guess_period, **more)


def roessler_rhs(t, x, c):
    return [-x[1] - x[2], x[0] + 0.2 * x[1], 0.2 + x[2] * (x[0] - c)]


def in_units(rhs, states, time=1.0):
    """x' = rhs(t, x, p) with every state and the time in other units."""

    def scaled(t, x, *args):
        slopes = rhs(t / time, [each / unit for each, unit in zip(x, states, strict=True)], *args)
        return [slope * unit / time for slope, unit in zip(slopes, states, strict=True)]

    return scaled


def roessler(c, guess_period=5.8, units=(1.0, 1.0, 1.0)):
    return from_rhs(in_units(roessler_rhs, units), 3, None, args=(c,), guess_period=guess_period)
