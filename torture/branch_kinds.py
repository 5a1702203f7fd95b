"""Random systems of twelve kinds, as lists of terms, with what a branch of each is asked for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray

from own_flow import METHOD, Surface, Term, Terms, flow, packed

Array = NDArray[np.float64]

_SAMPLES = 1500  # of an orbit that is looked for
_WILD = 300.0  # states: where motions of no interest go
_RETURNED = 0.15  # of the motion: so near, it is a return


@dataclass(frozen=True)
class Drawn:
    """A branch that is asked for.

    Attributes
    ----------
    system
        With the parameter p.
    between, at, rising
        Interval, where the branch starts and which way.
    guess, period
        A state, and a guess of the period where time does not enter.
    then
        "" or what the branch leaves: "doubling", "pitchfork" or "Hopf".
    symmetry, spatial, symmetric, method
        As they are declared.
    options
        Of ``follow``.
    """

    system: Terms
    between: tuple[float, float]
    at: float
    rising: bool
    guess: Array
    period: float | None = None
    then: str = ""
    symmetry: Array | None = None
    spatial: Array | None = None
    symmetric: bool = False
    method: str = "taylor"
    options: dict[str, Any] = field(default_factory=dict)


def _term(
    n: int, equation: int, factor: float, *states: int, turns: float = 0.0, phase: float = 0.0, side: int = 0
) -> Term:
    powers = tuple(states.count(state) for state in range(n))
    return Term(equation, factor, powers, 0.0, turns, phase, side)


def _log(chance: Random, low: float, high: float) -> float:
    return math.exp(chance.uniform(math.log(low), math.log(high)))


def _sign(chance: Random) -> float:
    return chance.choice((-1.0, 1.0))


def varied(chance: Random, terms: list[Term], among: list[int]) -> tuple[Term, ...]:
    """Terms of which one is multiplied by the parameter, which is 1 at first."""
    chosen = chance.choice(among)
    term = terms[chosen]
    terms[chosen] = replace(term, at_zero=0.0, slope=term.at_zero)
    return tuple(terms)


def _interval(chance: Random, widest: float = 1.0) -> dict[str, Any]:
    width = _log(chance, 0.3, 6.0 * widest)
    way = chance.randrange(3)
    between = ((1.0, 1.0 + width), (1.0 - min(width, 0.9), 1.0), (1.0 - 0.4 * min(width, 0.9), 1.0 + 0.6 * width))[way]
    rising = (True, False, chance.random() < 0.7)[way]
    options: dict[str, Any] = {"points": chance.choice((20, 40, 80)), "budget": 15_000}
    if chance.random() < 0.5:
        options["step"] = _log(chance, 1e-3, 0.2)
    if chance.random() < 0.3:
        options["longest"] = _log(chance, 0.03, 0.5)
    return {"between": between, "at": 1.0, "rising": rising, "options": options}


def moved(system: Terms, x: Array, p: float, time: float, parts: int = 1) -> Array:
    """States after parts of a time, shape (parts + 1, n); of a driven system a part is to be a number of periods."""
    data, floor, y = packed(system), np.ones(system.n), np.array(x, dtype=float)
    states = [y.copy()]
    for _ in range(parts):
        if flow(y, time / parts, system.n, p, data, floor, 1e-9, METHOD)[0] < 0 or not np.isfinite(y).all():
            raise ValueError("no motion")
        states.append(y.copy())
    return np.array(states)


def _settled(chance: Random, system: Terms, width: float = 1.0) -> Array:
    """A guess: where the motion goes from somewhere, or somewhere."""
    x = np.array([chance.gauss(0.0, width) for _ in range(system.n)])
    if chance.random() < 0.25:
        return x
    assert system.period is not None
    rounds = chance.choice((5, 20, 100))
    x = moved(system, x, 1.0, rounds * system.period, rounds)[-1]
    if np.abs(x).max() > _WILD:
        raise ValueError("it goes far away")
    return np.asarray(x * (1.0 + 1e-3 * chance.gauss(0.0, 1.0)))


def _cycle(chance: Random, system: Terms, time: float, width: float = 1.0) -> tuple[Array, float]:
    """A state that comes back, and after what time."""
    x = moved(system, np.array([chance.gauss(0.0, width) for _ in range(system.n)]), 1.0, 30.0 * time, 30)[-1]
    states = moved(system, x, 1.0, 3.0 * time, _SAMPLES)
    size = np.ptp(states, axis=0)
    if not (size > 1e-3).all():
        raise ValueError("it rests")
    off = np.abs((states - x) / size).max(axis=1)
    away = int(np.argmax(off > 2 * _RETURNED))
    back = np.flatnonzero(off[away:] < _RETURNED)
    if not away or not back.size:
        raise ValueError("it does not come back")
    first = away + int(back[0])
    within = off[first : first + _SAMPLES // 20]
    return x, 3.0 * time * (first + int(within.argmin())) / _SAMPLES


def _driven(chance: Random, n: int, frequency: float, odd: bool) -> list[Term]:
    terms = [_term(n, 1, _log(chance, 0.3, 30.0), turns=frequency, phase=chance.uniform(0, 6))]
    if not odd and chance.random() < 0.5:
        terms.append(_term(n, 1, _log(chance, 0.05, 2.0), turns=2.0 * frequency, phase=chance.uniform(0, 6)))
    return terms


def _duffing(chance: Random, odd: bool, damping: float, n: int = 2) -> tuple[list[Term], float]:
    frequency = _log(chance, 0.5, 2.0)
    terms = [
        _term(n, 0, 1.0, 1),
        _term(n, 1, -damping, 1),
        _term(n, 1, chance.choice((-1.0, 0.0, 1.0)) * _log(chance, 0.2, 3.0), 0),
        _term(n, 1, -_log(chance, 0.2, 2.0), 0, 0, 0),
        *_driven(chance, n, frequency, odd),
    ]
    if not odd:
        terms.append(_term(n, 1, chance.gauss(0.0, 0.5), 0, 0))
    return terms, 2.0 * math.pi / frequency


def forced(chance: Random) -> Drawn:
    """Driven oscillators of Duffing's and van der Pol's kind."""
    terms, period = _duffing(chance, False, _log(chance, 0.03, 0.5))
    if chance.random() < 0.3:
        terms.append(_term(2, 1, -_log(chance, 0.05, 1.0), 0, 0, 1))
        terms[1] = _term(2, 1, _log(chance, 0.05, 0.7), 1)
    system = Terms(2, varied(chance, terms, [1, 3, 4]), period)
    return Drawn(system, guess=_settled(chance, system), **_interval(chance))


def _random_quadratic(chance: Random) -> Terms:
    n = chance.choice((3, 3, 4))
    mu = _log(chance, 0.05, 0.5)
    terms = [_term(n, 0, mu, 0), _term(n, 0, -1.0, 1), _term(n, 1, 1.0, 0), _term(n, 1, mu, 1)]
    terms += [_term(n, i, -_log(chance, 0.3, 3.0), i) for i in range(2, n)]
    for i in range(n):
        terms += [_term(n, i, chance.gauss(0.0, 0.6), chance.randrange(n), chance.randrange(n)) for _ in range(2)]
        terms.append(_term(n, i, -_log(chance, 0.1, 1.0), i, i, i))
    return Terms(n, varied(chance, terms, list(range(len(terms)))), None)


def autonomous(chance: Random) -> Drawn:
    """Rössler's and Lorenz's equations, and quadratic ones at random."""
    which = chance.randrange(3)
    if which == 0:
        a, b, c = chance.uniform(0.1, 0.3), chance.uniform(0.1, 0.4), chance.uniform(1.5, 4.5)
        terms = [_term(3, 0, -1.0, 1), _term(3, 0, -1.0, 2), _term(3, 1, 1.0, 0), _term(3, 1, a, 1)]
        terms += [_term(3, 2, b), _term(3, 2, 1.0, 2, 0), _term(3, 2, -c, 2)]
        system, time = Terms(3, varied(chance, terms, [3, 4, 6]), None), 6.0
    elif which == 1:
        s, b, r = chance.uniform(8, 12), chance.uniform(2, 3), chance.uniform(150, 320)
        terms = [_term(3, 0, -s, 0), _term(3, 0, s, 1), _term(3, 1, r, 0), _term(3, 1, -1.0, 1)]
        terms += [_term(3, 1, -1.0, 0, 2), _term(3, 2, 1.0, 0, 1), _term(3, 2, -b, 2)]
        system, time = Terms(3, varied(chance, terms, [2, 2, 6]), None), 1.0
    else:
        system, time = _random_quadratic(chance), 6.0
    guess, period = _cycle(chance, system, time)
    return Drawn(system, guess=guess, period=period, **_interval(chance, 0.6))


def hybrid(chance: Random) -> Drawn:
    """Impacts on a wall, kicks, and resets of a cycle without a clock."""
    frequency, which = _log(chance, 0.6, 2.5), chance.randrange(3)
    bounce = ((1.0, 0.0), (0.0, -chance.uniform(0.3, 0.95)))
    terms = [_term(2, 0, 1.0, 1), _term(2, 1, -_log(chance, 0.02, 0.5), 1), _term(2, 1, -_log(chance, 0.5, 2.0), 0)]
    if which < 2:
        terms += _driven(chance, 2, frequency, chance.random() < 0.5)
        if which == 1:
            bounce = ((1.0, 0.0), (chance.gauss(0.0, 0.2), chance.uniform(0.5, 1.2)))
            terms.append(_term(2, 1, -_log(chance, 0.1, 1.0), 0, 0, 0))
        surface = Surface((1.0, 0.0), chance.uniform(-0.8, 0.1), chance.gauss(0.0, 0.1), -1, bounce)
        period = chance.choice((1, 1, 2)) * 2.0 * math.pi / frequency
        system = Terms(2, varied(chance, terms, [1, 2, 3]), period, (surface,))
        return Drawn(system, guess=_settled(chance, system), **_interval(chance))
    terms[1] = _term(2, 1, _log(chance, 0.1, 1.0), 1)
    terms.append(_term(2, 1, -_log(chance, 0.1, 1.0), 0, 0, 1))
    surface = Surface((1.0, 0.0), chance.uniform(-1.0, 0.5), 0.0, -1, ((1.0, 0.0), (0.0, chance.uniform(0.4, 1.1))))
    system = Terms(2, varied(chance, terms, [1, 2]), None, (surface,))
    guess, period = _cycle(chance, system, 7.0)
    return Drawn(system, guess=guess, period=period, **_interval(chance))


def doubled(chance: Random) -> Drawn:
    """Branches that leave a period doubling."""
    found = (forced, autonomous, symmetric, piecewise)[chance.randrange(4)](chance)
    return replace(found, then="doubling", symmetric=False, symmetry=None)


def symmetric(chance: Random) -> Drawn:
    """Pitchforks; the symmetry is declared or not."""
    declared, then = chance.random() < 0.6, chance.choice(("", "pitchfork", "pitchfork"))
    if chance.random() < 0.6:
        terms, period = _duffing(chance, True, _log(chance, 0.05, 0.5))
        system = Terms(2, varied(chance, terms, [1, 3, 4]), period)
        half, only = -np.eye(2) if declared else None, declared and chance.random() < 0.4
        guess = _settled(chance, system)
        return Drawn(system, guess=guess, symmetry=half, symmetric=only, then="" if only else then, **_interval(chance))
    one, period = _duffing(chance, False, _log(chance, 0.1, 0.5))
    coupling = chance.gauss(0.0, 0.5)
    terms = []
    for at in (0, 2):
        other = 2 - at
        for term in one:
            powers = [0, 0, 0, 0]
            powers[at], powers[at + 1] = term.powers
            terms.append(replace(term, equation=term.equation + at, powers=tuple(powers)))
        terms += [_term(4, at + 1, coupling, other), _term(4, at + 1, -coupling, at)]
    k, size = chance.choice((1, 3, 4)), len(terms) // 2
    for i in (k, k + size):
        terms[i] = replace(terms[i], at_zero=0.0, slope=terms[i].at_zero)
    system = Terms(4, tuple(terms), period)
    swap = np.eye(4)[[2, 3, 0, 1]] if declared else None
    guess = _settled(chance, system)
    if chance.random() < 0.7:
        guess = np.append(guess[:2], guess[:2])
    return Drawn(system, guess=guess, spatial=swap, then=then, **_interval(chance))


def conservative(chance: Random) -> Drawn:
    """No damping, or next to none."""
    damping = chance.choice((0.0, 0.0, 1e-3, 1e-5, -1e-4))
    terms, period = _duffing(chance, chance.random() < 0.5, damping)
    system = Terms(2, varied(chance, terms, [3, 4]), period)
    guess = np.array([chance.gauss(0.0, 0.5), chance.gauss(0.0, 0.5)])
    return Drawn(system, guess=guess, **_interval(chance))


def stiff(chance: Random) -> Drawn:
    """An oscillator with a state that decays much faster than it moves."""
    terms, period = _duffing(chance, False, _log(chance, 0.05, 0.5), 3)
    rate = _log(chance, 20.0, 250.0)
    terms += [_term(3, 2, -rate, 2), _term(3, 2, rate * chance.gauss(0.0, 1.0), 0, 0), _term(3, 2, rate * 0.3, 1)]
    terms.append(_term(3, 1, chance.gauss(0.0, 0.5), 2))
    system = Terms(3, varied(chance, terms, [1, 3, 4]), period)
    method = "implicit" if rate > 100.0 or chance.random() < 0.3 else "taylor"
    asked = _interval(chance)
    asked["options"] |= {"points": chance.choice((8, 15)), "budget": 3000}
    return Drawn(system, guess=_settled(chance, system), method=method, **asked)


def ring(chance: Random) -> Drawn:
    """A ring of oscillators, driven in step or not at all; its symmetry is declared or not."""
    m, declared, clocked = chance.choice((3, 3, 4)), chance.random() < 0.6, chance.random() < 0.6
    n, frequency = 2 * m, _log(chance, 0.6, 1.6)
    damping, spring, cubic = _log(chance, 0.1, 0.6), chance.gauss(0.5, 0.7), _log(chance, 0.3, 1.5)
    coupling, force, terms = chance.gauss(0.0, 0.4), _log(chance, 0.3, 5.0), []
    which = chance.choice((0, 1, 2)) if clocked else chance.choice((0, 1))

    def add(number: int, term: Term) -> None:
        terms.append(replace(term, at_zero=0.0, slope=term.at_zero) if number == which else term)

    for i in range(m):
        a, left, right = 2 * i, 2 * ((i - 1) % m), 2 * ((i + 1) % m)
        add(9, _term(n, a, 1.0, a + 1))
        add(0, _term(n, a + 1, -damping if clocked else damping, a + 1))
        add(9, _term(n, a + 1, -spring if clocked else -1.0, a))
        add(9, _term(n, a + 1, -cubic, *((a, a, a) if clocked else (a, a, a + 1))))
        for j in (left, right):
            add(1, _term(n, a + 1, coupling, j))
            add(1, _term(n, a + 1, -coupling, a))
        if clocked:
            add(2, _term(n, a + 1, force, turns=frequency))
    system = Terms(n, tuple(terms), 2.0 * math.pi / frequency if clocked else None)
    shift = np.eye(n)[[(i + 2) % n for i in range(n)]] if declared else None
    if clocked:
        guess = _settled(chance, system)
        guess = np.tile(guess[:2], m) if chance.random() < 0.6 else guess
        return Drawn(system, guess=guess, spatial=shift, **_interval(chance))
    guess, period = _cycle(chance, system, 7.0)
    guess = np.tile(guess[:2], m) if chance.random() < 0.5 else guess
    return Drawn(system, guess=guess, period=period, spatial=shift, **_interval(chance))


def hopf_born(chance: Random) -> Drawn:
    """Cycles that are born at an equilibrium."""
    n = chance.choice((2, 3, 3, 4))
    turning, shift = _log(chance, 0.5, 3.0), chance.uniform(0.6, 1.3)
    terms = [_term(n, 0, -turning, 1), _term(n, 1, turning, 0)]
    for i in (0, 1):  # the rate is p - shift
        terms.append(Term(i, -shift, tuple(int(j == i) for j in range(n)), 1.0))
    terms += [_term(n, i, -_log(chance, 0.3, 3.0), i) for i in range(2, n)]
    for i in range(n):
        terms += [_term(n, i, chance.gauss(0.0, 0.7), chance.randrange(n), chance.randrange(n)) for _ in range(3)]
        terms.append(_term(n, i, -_log(chance, 0.1, 2.0), i, i, i))
        terms.append(_term(n, i, chance.gauss(0.0, 0.02)))
    system = Terms(n, tuple(terms), None)
    asked = _interval(chance)
    asked |= {"between": (shift - chance.uniform(0.1, 0.5), shift + chance.uniform(0.1, 0.8))}
    asked |= {"at": asked["between"][0], "rising": True}
    return Drawn(system, guess=np.zeros(n), period=2.0 * math.pi / turning, then="Hopf", **asked)


def piecewise(chance: Random) -> Drawn:
    """Driven oscillators whose spring or damper is another one beyond a place."""
    frequency, at = _log(chance, 0.5, 2.0), chance.uniform(-0.5, 0.8)
    terms = [_term(2, 0, 1.0, 1), _term(2, 1, -_log(chance, 0.05, 0.5), 1), _term(2, 1, -_log(chance, 0.2, 2.0), 0)]
    terms += _driven(chance, 2, frequency, chance.random() < 0.5)
    stiffness = _log(chance, 0.3, 20.0)
    terms += [_term(2, 1, -stiffness, 0, side=1), _term(2, 1, stiffness * at, side=1)]
    if chance.random() < 0.4:
        terms.append(_term(2, 1, -_log(chance, 0.05, 1.0), 1, side=chance.choice((-1, 1))))
    system = Terms(2, varied(chance, terms, [1, 2, 3]), 2.0 * math.pi / frequency, (Surface((1.0, 0.0), at),))
    return Drawn(system, guess=_settled(chance, system), **_interval(chance))


def relaxation(chance: Random) -> Drawn:
    """Van der Pol's and FitzHugh and Nagumo's oscillators."""
    mu = _log(chance, 1.0, 12.0)
    if chance.random() < 0.5:
        terms = [_term(2, 0, 1.0, 1), _term(2, 1, mu, 1), _term(2, 1, -mu, 0, 0, 1), _term(2, 1, -1.0, 0)]
        terms.append(_term(2, 1, chance.gauss(0.0, 0.3)))
        system, time = Terms(2, varied(chance, terms, [1, 2, 3]), None), 6.0 + 1.6 * mu
    else:
        slow, current = _log(chance, 0.03, 0.3), chance.uniform(0.4, 1.2)
        terms = [_term(2, 0, 1.0, 0), _term(2, 0, -1.0 / 3.0, 0, 0, 0), _term(2, 0, -1.0, 1), _term(2, 0, current)]
        terms += [_term(2, 1, slow, 0), _term(2, 1, 0.7 * slow), _term(2, 1, -0.8 * slow, 1)]
        system, time = Terms(2, varied(chance, terms, [0, 3, 4]), None), 6.0 + 2.5 / slow
    guess, period = _cycle(chance, system, time)
    method = chance.choice(("taylor", "taylor", "implicit"))
    return Drawn(system, guess=guess, period=period, method=method, **_interval(chance, 0.6))


def badly_scaled(chance: Random) -> Drawn:
    """Another kind in units in which its states differ by many powers of ten."""
    made = chance.choice((forced, autonomous, hybrid, symmetric, piecewise, relaxation))(chance)
    n = made.system.n
    sizes = np.array([10.0 ** chance.uniform(-8, 8) for _ in range(n)])
    if made.spatial is not None:
        sizes = np.append(sizes[:2], sizes[:2])
    time, unit = 10.0 ** chance.uniform(-4, 4), 10.0 ** chance.uniform(-6, 6)
    low, high = made.between
    return replace(
        made,
        system=made.system.scaled(sizes, time, unit),
        between=(low * unit, high * unit),
        at=made.at * unit,
        guess=made.guess * sizes,
        period=None if made.period is None else made.period * time,
    )


KINDS: dict[str, Callable[[Random], Drawn]] = {
    "forced": forced,
    "autonomous": autonomous,
    "hybrid": hybrid,
    "doubled": doubled,
    "symmetric": symmetric,
    "conservative": conservative,
    "stiff": stiff,
    "ring": ring,
    "hopf": hopf_born,
    "piecewise": piecewise,
    "relaxation": relaxation,
    "scaled": badly_scaled,
}


def drawn(kind: str, chance: Random) -> Drawn:
    """A branch of a kind; systems without a motion are drawn anew."""
    for _ in range(50):
        try:
            return KINDS[kind](chance)
        except ValueError:
            continue
    raise RuntimeError(f"no system of kind {kind}")
