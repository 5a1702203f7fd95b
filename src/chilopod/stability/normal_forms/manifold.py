"""The centre manifold of a critical orbit, and the return map on it, from samples of the return map.

The manifold is W(z) = x + z q + z^2 w20 + ... (and complex conjugates), with z real at a real multiplier. At first it
is the critical eigenspace. A :class:`Manifold` samples the return map H on circles |z| = r, or at z = +-r. Fourier
series in the angle and Chebyshev series in r give the Taylor coefficients of H(W(z)). Their excess over W's own
determines the bend of W (the homological equations of Kuznetsov, *Elements of Applied Bifurcation Theory*, section 8.7,
and of Kuznetsov and Meijer 2005, here with measured numbers). Units of the states do not matter, as every entry of a
state is compared with itself only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.stability.returns import ReturnMap

StateMap = Callable[[Array], Array]  # the return map: states, shape (k, n), to their images, shape (k, n)
Powers = tuple[int, int]  # i and j of a monomial z^i conj(z)^j; j = 0 where z is real

ManifoldCurve = Mapping[Powers, ComplexArray]
"""Coefficient of every monomial, shape (n,); of two conjugate ones only the one with i >= j."""

Term = tuple[complex, float]  # a coefficient and its error

_ANGLES = 8
_HIGHEST = 5.0  # highest power of a radius that must not overflow
_DRAWS = 3  # randomly disturbed curves
_SURE = 2.0  # factor on the effect of the worst of them
_WRONG = 0.3  # size of their disturbance, relative to the motion of the states


@dataclass(frozen=True, eq=False)
class CriticalOrbit(ReadOnlyArrays):
    """A fixed point of a return map, with its critical multiplier."""

    state: Array  # the fixed point, shape (n,)
    image: ReturnMap  # return map there, with the errors of its derivative
    multiplier: complex  # nu: exactly +1, exactly -1, or the one of a complex pair with the mode ``right``
    right: ComplexArray  # critical eigenvectors, shape (n,), of unit size in the user's units, and left^H right = 1
    left: ComplexArray

    @property
    def real(self) -> bool:
        return self.multiplier.imag == 0.0

    @property
    def times(self) -> int:
        """Number of returns in the map of the coefficients: a full period, or two for a multiplier -1 after one."""
        k = self.image.returns
        return 2 * k if self.multiplier == -1.0 and k % 2 else k

    def turns(self) -> ComplexArray:
        """Sampled directions of z: +-1 for a real one, else a circle."""
        count = 2 if self.real else _ANGLES
        return np.asarray(np.exp(2j * np.pi * np.arange(count) / count))

    def displacements(self, curve: ManifoldCurve, z: ComplexArray) -> Array:
        """W(z) - x, shape (*z.shape, n)."""
        total = np.zeros((*z.shape, self.state.size))
        for (i, j), coefficient in curve.items():
            twice = 1.0 if self.real or i == j else 2.0
            total += twice * ((z**i * z.conj() ** j)[..., None] * coefficient).real
        return total


@dataclass(frozen=True)
class Sampled:
    """Chebyshev series of the harmonics of H(W(z)) - x."""

    harmonics: tuple[Series, ...]  # by index, negative ones last; of n states and, at the end, left^H (H(W(z)) - x)
    noise: Array  # bounds on the errors of the samples, shape (n + 1,)
    blur: float  # error of the projection at x itself, from round-off and the map's error
    shrink: float  # factor of the radius at which the series of the projection would fall to the expected noise
    falling: bool  # True if the series still fall at their end, unlike noise
    size: Array  # largest distance of every state from x, on the curve or its image, shape (n,)
    radius: float  # largest |z|
    outermost: complex  # first harmonic of the projection at the largest of the radii

    def taylor(self, powers: Powers) -> tuple[ComplexArray, Array]:
        """Coefficient of a monomial in H(W(z)), and its error: shape (n + 1,)."""
        i, j = powers
        order = i + j
        value, error = self.harmonics[(i - j) % len(self.harmonics)].taylor(order, self.noise)
        return value / self.radius**order, error / self.radius**order

    def term(self, powers: Powers) -> Term:
        """Coefficient of a monomial in the projection of H(W(z)), and its error."""
        value, error = self.taylor(powers)
        return complex(value[-1]), float(error[-1])


class Manifold:
    """The centre manifold up to the order below that of a coefficient, 3 or 5, improved on samples of the return map.

    It is determined by H(W(z)) = W(g(z)), with the map g on the critical space, and has no part along q at resonant
    monomials (Kuznetsov, sections 9.3 and 9.4; Govaerts, Ghaziani, Kuznetsov & Meijer, SIAM J. Sci. Comput. 29, 2007).
    """

    def __init__(self, mapped: StateMap, at: CriticalOrbit, order: int) -> None:
        self._mapped, self.at, self._order = mapped, at, order
        if at.real:
            nu = at.multiplier.real
            self._resonant = {(k, 0): nu**k == nu for k in range(2, order)}
        else:
            monomials = [(total - j, j) for total in range(2, order) for j in range(total // 2 + 1)]
            self._resonant = {(i, j): i == j + 1 for i, j in monomials if i < 4}  # z^4 does not reach z^3 conj(z)^2
        nothing = np.zeros(at.state.size, dtype=np.complex128)
        self.curve: dict[Powers, ComplexArray] = {(1, 0): at.right.astype(np.complex128)}
        self.curve |= dict.fromkeys(self._resonant, nothing)

    def images(self, displaced: Array) -> Array | None:
        """H - x at x + ``displaced``, of the same shape; None where the map is undefined."""
        x = self.at.state
        try:
            result = np.asarray(self._mapped(x + displaced.reshape(-1, x.size)), dtype=np.float64)
        except (AnalysisError, ArithmeticError):
            return None
        result = result.reshape(displaced.shape) - x
        return result if np.isfinite(result).all() else None

    def sample(self, radius: float) -> Sampled | None:
        """The map on the manifold up to a radius; None where it is undefined."""
        at = self.at
        directions = at.turns()
        displaced = at.displacements(self.curve, radius * RADII[:, None] * directions)
        highest = np.power(radius, _HIGHEST)
        if not (0.0 < highest < np.inf and np.isfinite(displaced).all()):
            return None
        image = self.images(displaced)
        if image is None:
            return None
        columns = np.concatenate([image, (image @ at.left.conj())[..., None]], axis=-1)
        harmonics = np.fft.fft(columns, axis=1) / directions.size
        if not np.isfinite(harmonics).all():
            return None
        found = tuple(series(harmonics[:, h], h % 2) for h in range(directions.size))
        size = np.maximum(np.abs(displaced), np.abs(image)).max(axis=(0, 1))
        blur, floor = (_expected_noise(at, reached) for reached in (np.abs(at.state), np.abs(at.state) + size))
        # A cosine transform spreads the noise of the samples evenly over the coefficients, smaller by this factor.
        seen = np.sqrt(RADII.size / 2.0) * np.max([one.roughness for one in found], axis=0)
        shrink = float(min(1.0, floor[-1] / seen[-1]) ** (0.5 / (RADII.size - 2))) if seen[-1] > 0.0 else 1.0
        falling = any(one.falling[-1] for one in found)
        noise = np.maximum(floor, seen)
        return Sampled(found, noise, float(blur[-1]), shrink, falling, size, radius, harmonics[0, 1, -1])

    def bend(self, found: Sampled) -> bool:
        """Improve the manifold from samples on it; return True if it changed measurably."""
        bent = False
        for powers, (excess, error) in self._excess(found).items():
            if (np.abs(excess) > 2.0 * error).any():
                bent = True
                self.curve[powers] = self.curve[powers] + self._bend_by(powers, excess)
        return bent

    def coefficient(self, found: Sampled, powers: Powers) -> Term:
        """Coefficient of a resonant monomial of odd order, and a bound on its error, which includes the difference of
        the sampled curve from the centre manifold: curves disturbed as much at random are sampled too. The modes err as
        rounding turns them towards those of near multipliers."""
        at, (value, error) = self.at, found.term(powers)
        n, random = at.state.size, np.random.default_rng(0)
        directions = at.turns()
        largest = found.radius * RADII[0]
        z = largest * directions
        off = {each: np.abs(excess) + uncertain for each, (excess, uncertain) in self._excess(found).items()}
        matrix, q, p = at.image.jacobian, at.right, at.left.conj()
        rounding = at.image.error + 4.0 * np.finfo(float).eps * np.abs(matrix)
        right, left = matrix @ q, p @ matrix
        off[1, 0] = np.abs(right - q * (p @ right)) + rounding @ np.abs(q)
        # The image across the mode, which an error of p projects onto it.
        across = np.abs(self._bend_by(powers, found.taylor(powers)[0][:-1]))
        error += float((np.abs(left - (left @ q) * p) + np.abs(p) @ rounding) @ across)
        shifts, factors, longer = [], [], 0.0
        for _ in range(_DRAWS):
            wrong = {}
            for each, difference in off.items():
                signs = random.choice([-1.0, 1.0], n) if at.real else np.exp(2j * np.pi * random.random(n))
                wrong[each] = self._bend_by(each, signs * difference)
            longer = max(longer, float(abs(q.conj() @ wrong[1, 0]) / (q.conj() @ q).real))
            shift = at.displacements(wrong, z)
            ratios = np.abs(shift).max(axis=0) / found.size
            ratios = ratios[np.isfinite(ratios) & (ratios > 0.0)]
            if ratios.size:
                factors.append(_WRONG / float(ratios.max()))
                shifts.append(factors[-1] * shift)
        if not shifts:
            return value, error
        image = self.images(at.displacements(self.curve, z) + np.array(shifts))
        if image is None:
            return value, np.inf
        harmonics = np.fft.fft(image @ at.left.conj())[:, 1] / directions.size
        moved = np.abs(harmonics - found.outermost) / (np.array(factors) * largest ** sum(powers))
        return value, error + _SURE * (float(moved.max()) + (sum(powers) - 1) * longer * abs(value))

    def _bend_by(self, powers: Powers, excess: NDArray[np.inexact]) -> ComplexArray:
        """Solution w of (nu^i conj(nu)^j - A) w = excess, shape (n,), without a part along q if resonant."""
        i, j = powers
        nu, n = self.at.multiplier, self.at.state.size
        matrix = nu**i * nu.conjugate() ** j * np.eye(n) - self.at.image.jacobian
        if not self._resonant.get(powers, True):
            return np.asarray(np.linalg.solve(matrix, excess), dtype=np.complex128)
        q, p = self.at.right, self.at.left
        bordered = np.block([[matrix, q[:, None]], [p.conj()[None], np.zeros((1, 1))]])
        padded = np.append(excess - q * (p.conj() @ excess), 0.0)
        return np.asarray(np.linalg.solve(bordered, padded)[:n], dtype=np.complex128)

    def _excess(self, found: Sampled) -> dict[Powers, tuple[ComplexArray, Array]]:
        """Excess of H(W) over W(g) at every monomial of the manifold, with its error: shape (n,) both."""
        terms = {powers: found.taylor(powers) for powers in self._resonant}
        inner = np.zeros((self._order, self._order), dtype=np.complex128)
        inner[1, 0] = self.at.multiplier
        for powers in (each for each, resonant in self._resonant.items() if resonant):
            inner[powers] = found.term(powers)[0]
        outer = np.zeros((self._order, self._order, self.at.state.size), dtype=np.complex128)
        for (i, j), coefficient in self.curve.items():
            outer += _monomial(inner, i, j)[..., None] * coefficient
            if not self.at.real and i != j:
                outer += _monomial(inner, j, i)[..., None] * coefficient.conj()
        return {powers: (value[:-1] - outer[powers], error[:-1]) for powers, (value, error) in terms.items()}


def _expected_noise(at: CriticalOrbit, reached: Array) -> Array:
    """Errors of images of a size, shape (n,), and of their projection, shape (n + 1,)."""
    rounding = 2.0 * np.finfo(float).eps * (reached + np.abs(at.image.jacobian) @ reached)
    return np.append(rounding, np.abs(at.left) @ rounding)


def _monomial(inner: ComplexArray, i: int, j: int) -> ComplexArray:
    """Coefficients of g^i conj(g)^j below the order of ``inner``, the coefficients of g."""
    result = np.zeros_like(inner)
    result[0, 0] = 1.0
    for factor in [inner] * i + [inner.conj().T] * j:
        product = np.zeros_like(inner)
        for k, m in np.argwhere(factor):
            product[k:, m:] += factor[k, m] * result[: len(inner) - k, : len(inner) - m]
        result = product
    return result


RADII: Array = np.cos((2 * np.arange(8) + 1) * np.pi / 32)
"""Radii at which a function is sampled: the positive Chebyshev points of the first kind of [-1, 1], falling."""

_SAFETY = 5.0  # factor on the noise, estimated from few samples, and the truncation, from the next two terms
_FALL = 4.0
_TAIL = 2  # number of last coefficients of every parity that count as noise


@dataclass(frozen=True, eq=False)
class Series(ReadOnlyArrays):
    """Chebyshev coefficients t_k over [-1, 1] of functions that are even or odd.

    Samples at the positive Chebyshev points give all others. The t_k fall geometrically down to the noise of the
    samples, so the series itself shows the size of that noise, the truncation error, and the quality of the interval
    (Trefethen, *Approximation Theory and Approximation Practice*, chapters 3, 4 and 8). A Taylor coefficient is a sum
    over the t_k up to the degree with the least sum of noise and truncation.
    """

    coefficients: ComplexArray  # coefficients of T_parity, T_(parity + 2), ..., shape (radii, entries)
    parity: int  # 0 for even functions, 1 for odd ones

    @property
    def roughness(self) -> Array:
        """Size of the last coefficients, shape (entries,): noise of the samples, or truncation error."""
        return np.asarray(np.abs(self.coefficients[-_TAIL:]).max(axis=0))

    @property
    def falling(self) -> NDArray[np.bool_]:
        """True if the coefficients still fall at their end, unlike noise, shape (entries,)."""
        before: Array = np.abs(self.coefficients[-2 * _TAIL : -_TAIL]).max(axis=0)
        return np.asarray(before > _FALL * self.roughness)

    def taylor(self, order: int, noise: Array) -> tuple[ComplexArray, Array]:
        """Taylor coefficients of one order, and bounds on their errors from those of the samples, shape (entries,)."""
        weights, gains = _weights(order, self.parity)
        terms = weights[:, None] * self.coefficients
        sizes = np.abs(terms)
        # Coefficients after the next two count only above the noise.
        standing_out = np.maximum(sizes - 2.0 * np.abs(weights[:, None]) * self.roughness, 0.0)
        beyond = np.cumsum(np.vstack([np.zeros(noise.size), standing_out[::-1]]), axis=0)[::-1]
        first, last = (order - self.parity) // 2, RADII.size - _TAIL
        after = sizes[first + 1 : last + 1] + sizes[first + 2 : last + 2] + beyond[first + 3 : last + 3]
        errors = _SAFETY * (gains[first:last, None] * noise + after)
        errors = np.where(errors < np.inf, errors, np.inf)
        best, entries = errors.argmin(axis=0), np.arange(noise.size)
        return np.cumsum(terms, axis=0)[first + best, entries], errors[best, entries]


def series(values: ComplexArray, parity: int) -> Series:
    """The series of functions sampled at the radii, shape (radii, entries)."""
    return Series(_transform(parity) @ values, parity)


@cache
def _transform(parity: int) -> Array:
    """Discrete cosine transform of a function of one parity, from its values at positive points."""
    orders = np.arange(parity, 2 * RADII.size, 2)
    matrix = 2.0 / RADII.size * np.cos(np.outer(orders, np.arccos(RADII)))
    if parity == 0:
        matrix[0] *= 0.5
    return matrix


@cache
def _weights(order: int, parity: int) -> tuple[Array, Array]:
    """Coefficient of r^order in every T_k, and the factor of the sum up to each k on an error of the samples."""
    orders = np.arange(parity, 2 * RADII.size, 2)
    one = np.eye(2 * RADII.size)
    weights = np.array([chebyshev.cheb2poly(one[k])[order] if k >= order else 0.0 for k in orders])
    return weights, np.abs(np.cumsum(weights[:, None] * _transform(parity), axis=0)).sum(axis=1)
