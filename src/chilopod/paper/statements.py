"""Statements of the paper on its robot, and further conditions on the twin, in the order of the table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper import printed
from chilopod.paper.printed import CRITERION_NAMES, Band, Number, Said, walking_speed
from chilopod.paper.table import Kind, Statement
from chilopod.show.words import listing
from chilopod.steering import Outcome

_FITTED, _PREDICTED, _CHECKED = Kind


@dataclass(frozen=True)
class VariantStatements:
    """Statements on a variant: where curved walks set in, and how wide they are."""

    onset: Statement[Band]
    radius: Statement[Band]


@dataclass(frozen=True)
class TaskStatements:
    """Statements on a turning task: the spring of its circle, its outcome, and the minima of the criteria."""

    k_hat: Statement[Band]
    outcomes: Statement[Said]
    minima: Mapping[str, Statement[Band]]


def _number(quantity: str, number: Number, kind: Kind) -> Statement[Band]:
    return Statement(quantity, number.band, kind)


def _said(quantity: str, words: str, condition: str, kind: Kind = _PREDICTED) -> Statement[Said]:
    return Statement(quantity, Said(words, condition), kind)


def _duration(what: str) -> Statement[Said]:
    quantity = f"{what}, by how long the walks last"
    return _said(quantity, "not printed how long", "the same verdict after each", _CHECKED)


def _of_task(letter: str, task: printed.Task) -> TaskStatements:
    k_hat, springs = task.k_hat, task.outcomes
    name = f"task {letter}"
    if springs:
        words = ", ".join(f"{outcome.label} at {spring:g}" for outcome, spring in springs.items())
        words += f" {PAPER_UNIT}, all five at {springs[Outcome.ARRIVED]:g}"
        became = Said(words, "the same at these springs, and all repeats arrive")
    else:
        became = Said(f"best around {k_hat}", "arrives there; stiffer miss outside, softer inside")
    own = _number(f"{name}: k1 whose walk has the radius of the circle", k_hat, _PREDICTED)
    minima = {
        key: Statement(f"{name}: smallest {title}", task.minima, _PREDICTED) for key, title in CRITERION_NAMES.items()
    }
    return TaskStatements(own, Statement(f"{name}: what becomes of it", became, _PREDICTED), minima)


def listed(springs: Sequence[float]) -> str:
    """Springs in rising order: 15, 17 and 21."""
    return listing(f"{spring:g}" for spring in sorted(springs))


STRAIGHT = _said(f"walks with k1 = {listed(printed.STRAIGHT)} {PAPER_UNIT}", "straight", "most trials", _FITTED)
CURVED = _said(
    f"walks with k1 = {listed(printed.CURVED)} {PAPER_UNIT}",
    "curved, to both sides",
    "most trials at each; both sides",
    _FITTED,
)
ONSET = _number("where curved walks set in (square-root fit)", printed.ONSET, _FITTED)
RADII = {
    spring: _number(f"radius at k1 = {spring:g} {PAPER_UNIT}", radius, _FITTED)
    for spring, radius in printed.RADII.items()
}
_SPEED, _WITHIN = walking_speed(), printed.SPEED
_SAID = f"{_SPEED:.3f} m/s, from {printed.ARRIVAL} to {printed.TASKS['A'].target}"
_AROUND = Band(_SAID, f"{100.0 * _WITHIN:.0f} %", (1.0 - _WITHIN) * _SPEED, (1.0 + _WITHIN) * _SPEED)
SPEED: Statement[Band] = Statement(f"speed of module 1 at k1 = {printed.TASKS['A'].k_hat}", _AROUND, _FITTED)
RISING = _said("angle of joint 1 over 1/k1", "increases", "from every spring to the next")
FLUCTUATION = _said(
    "fluctuation among trials over 1/k1, joint 1", "increases", "from the stiffest spring that curves to the softest"
)
VARIANTS = {
    name: VariantStatements(
        _number(f"where curved walks set in, {name}", variant.onset, _PREDICTED),
        Statement(f"radius, {name}", variant.radius, _PREDICTED),
    )
    for name, variant in printed.VARIANTS.items()
}
UNIFORM = _number("where the straight walk ends, all springs alike", printed.UNIFORM, _PREDICTED)
# The springs next to the onset are those that need the longest.
SLOWEST = {"curved": max(printed.CURVED), "straight": min(printed.STRAIGHT)}
ONSET_BY_DURATION = _duration("onset")
RADII_BY_DURATION = {spring: _duration(f"radius at {spring:g} {PAPER_UNIT}") for spring in printed.RADII}
WALKS_BY_DURATION = {what: _duration(f"walks {what} at {spring:g} {PAPER_UNIT}") for what, spring in SLOWEST.items()}
TASKS = {letter: _of_task(letter, task) for letter, task in printed.TASKS.items()}
ARRIVAL = _number("task A: earliest arrival", printed.ARRIVAL, _FITTED)
WITHOUT = _said(
    f"task A without leg yaw, k1 = {printed.TASKS['A'].k_hat}",
    f"many of {printed.WITHOUT_LEG_YAW} fail, with it {printed.REPEATS} of {printed.REPEATS} arrive",
    f"at most {printed.WITHOUT_LEG_YAW // 2} arrive without, all with",
)
HOPF = _said(
    "task A, pitchfork against Hopf: smallest criteria", "lower for the pitchfork, all three", "all three lower"
)
HOPF_SPRINGS = _said(
    "task A, Hopf: springs of the smallest criteria",
    f"below the Hopf point, {printed.UNIFORM}",
    "all below where its own body undulates",
)
NUMERICS: Statement[Band] = Statement(
    "numerics: finer steps, tight contact solver", Band("no counterpart", "less than 5 %", 0.0, 0.05), _CHECKED
)
"""Statement on the largest relative move."""

_LIMIT = Band("no counterpart", "3 % of the planar model", 0.97, 1.03)
PLANAR_LIMIT: Statement[Band] = Statement("planar limit of the twin: where the straight walk is lost", _LIMIT, _CHECKED)
"""Point of the twin's planar limit over that of the planar model."""

ORDER: tuple[Statement[Said], ...] = (
    *(STRAIGHT, CURVED, ONSET, *RADII.values(), SPEED, RISING, FLUCTUATION),
    *(each for variant in VARIANTS.values() for each in (variant.onset, variant.radius)),
    *(UNIFORM, ONSET_BY_DURATION, *RADII_BY_DURATION.values(), *WALKS_BY_DURATION.values()),
    *(each for task in TASKS.values() for each in (task.k_hat, task.outcomes, *task.minima.values())),
    *(ARRIVAL, WITHOUT, HOPF, HOPF_SPRINGS, NUMERICS, PLANAR_LIMIT),
)
