"""What a second program says of a branch: whether its orbits close, its multipliers, its special points, its end."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from branch_kinds import Drawn
from own_orbits import COARSE, Crossing, NoOrbit, Orbits, Segment, Solved, real_roots

Array = NDArray[np.float64]

_CLOSES = 1e-10  # of the sizes, times what a return magnifies
_PRECISION = 1e-11  # of the sizes of the branch: ten times what is asked for
_ROUNDING = 3e-14
_ORBIT = 5e-15  # of the sizes: the rounding of an orbit of this program
_SMALL = 1e-6  # multipliers of this modulus have no bound
_SPECIAL = 0.03  # of a segment: the first orbits behind a point where branches meet
_LARGEST = 2e4  # a return that magnifies more is beyond this program
_TESTS = {"period doubling": 1, "Neimark-Sacker": 2, "Krein collision": 2}
_VAGUE = 0.03  # of a segment: a crossing of this program so uncertain is none
_PARTS = 16
_TOUCHED = 0.01  # of a segment: orbits nearer to a touch of the circle are not used
_NEAR = 0.1  # of a segment: the value of a point tells its place badly where the curve turns


@dataclass
class Verdict:
    """What came of a branch: counts, and a sentence for each fault, gap, and failure of this program."""

    counts: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    gaps: list[str] = field(default_factory=list)
    own: list[str] = field(default_factory=list)

    def fault(self, what: str, said: str) -> None:
        """Count a fault."""
        self.counts[what] += 1
        self.faults.append(f"{what}: {said}")

    def gap(self, said: str) -> None:
        """Count what is said not to be known."""
        self.counts["gaps"] += 1
        self.gaps.append(said)


def checked(asked: Drawn, branch: Any) -> Verdict:
    """Compare a branch with what a second program finds."""
    found = Verdict()
    orbits = own_orbits(asked, branch)
    ordinary = [point for point in branch.points if point.special is None]
    solved: dict[int, Solved] = {}
    for point in ordinary:
        try:
            mine = _orbit(found, orbits, point)
        except NoOrbit as reason:
            found.own.append(f"orbit at {point.value!r}: {reason}")
            continue
        if mine is not None:
            solved[id(point)] = mine
    _periods(found, orbits, branch, solved)
    _segments(found, orbits, asked, branch, solved)
    _end(found, orbits, asked, branch, solved)
    return found


def own_orbits(asked: Drawn, branch: Any) -> Orbits:
    """This program for the system of a branch, in sizes that its orbits have."""
    system, points = asked.system, branch.points
    scale = asked.between[1] - asked.between[0]
    time = max(float(point.period or 1.0) for point in points)
    one = np.ones(system.n) if not system.sizes else np.array(system.sizes)
    rough = Orbits(system, one, scale, time, branch.periods)
    states = []
    for point in (points[0], points[len(points) // 2], points[-1]):
        z = rough.z(point.orbit, point.value, point.period)
        states += [np.abs(rough.state_after(z, part / _PARTS)) * one for part in range(1, _PARTS)]
    sizes = np.max(states, axis=0)
    return Orbits(system, np.maximum(sizes, 1e-6 * one), scale, time, branch.periods)


def _orbit(found: Verdict, orbits: Orbits, point: Any) -> Solved | None:
    """The orbit nearest to a stated one: it is to be there, and to have the stated multipliers."""
    z = orbits.z(point.orbit, point.value, point.period)
    here = orbits.returned(z)
    norm = float(np.linalg.norm(here.matrix, 2))
    if norm > _LARGEST:
        found.counts["beyond"] += 1
        return None
    found.counts["orbits"] += 1
    off = float(np.abs(here.off).max())
    # Beside a canard an orbit magnifies within what it has forgotten at its end: both programs are rounded there.
    rounded = _ROUNDING * float(np.abs(here.by_parameter).max())
    own = max(rounded, float(np.abs(here.off - orbits.returned(z, COARSE).off).max()))
    # Orbits are solved for to a precision of the branch's own sizes, which may be larger than they are.
    coarse = _PRECISION * float((point.units[:-1] / orbits.sizes).max())
    found.counts["coarse"] += off > _CLOSES * max(1.0, norm) + 3.0 * own
    if off > max(_CLOSES, coarse) * max(1.0, norm) + 3.0 * own:
        found.fault("not closed", f"at {point.value!r} the orbit misses its start by {off:.1e} (own error {own:.1e})")
        return None
    tangent = np.append(point.tangent[:-1] * point.units[:-1] / orbits.sizes, point.tangent[-1])
    mine = orbits.solved(z, tangent / np.linalg.norm(tangent))
    _multipliers(found, orbits, point, mine)
    return mine


def _multipliers(found: Verdict, orbits: Orbits, point: Any, mine: Solved) -> None:
    along = np.append(np.zeros(orbits.n), 1.0)
    other = orbits.finished(mine.z, along, COARSE).matrix
    values, right = np.linalg.eig(mine.matrix)
    try:
        left = np.linalg.inv(right)
    except np.linalg.LinAlgError:
        return
    norm = float(np.linalg.norm(mine.matrix, 2))
    wrong = np.linalg.norm(left, axis=1) * (float(np.linalg.norm(mine.matrix - other, 2)) + _ROUNDING * (1.0 + norm))
    stated = np.asarray(point.multipliers)
    if orbits.free:  # the motion itself is none of them
        stated = np.append(stated, 0.0)
    rows, columns = linear_sum_assignment(np.abs(values[:, None] - stated))
    # An orbit is as close as its precision says, which its multipliers feel.
    moved = orbits.z(point.orbit, point.value, point.period) - mine.z
    felt = float(np.abs(moved).max()) / 1e-6
    beside = mine.z + 1e-6 * moved / max(float(np.abs(moved).max()), 1e-300)
    shifted = np.linalg.norm(orbits.finished(beside, along).matrix - mine.matrix, 2)
    for i, j in zip(rows, columns, strict=True):
        off = abs(values[i] - stated[j])
        sensitive = float(np.linalg.norm(left[i]) * shifted)
        felt_here, bound = sensitive * felt, point.error_bound
        wrong[i] += sensitive * _ORBIT / 1e-6
        if abs(values[i]) < _SMALL and off < _SMALL:
            continue
        if off > bound + 3.0 * wrong[i] + 2.0 * felt_here:
            if wrong[i] > 1e-4 * abs(values[i]) + 1e-4:
                found.own.append(f"multipliers at {point.value!r} are uncertain by {wrong[i]:.1e}")
                return
            found.fault(
                "multipliers",
                f"at {point.value!r} {stated[j]:.15g} is {values[i]:.15g}, bound {bound:.1e}, own error {wrong[i]:.1e}",
            )
            return
        if off > bound + 3.0 * wrong[i]:
            found.counts["orbit felt"] += 1


def _periods(found: Verdict, orbits: Orbits, branch: Any, solved: dict[int, Solved]) -> None:
    """The period is the shortest one."""
    if branch.periods != 1 or not orbits.free:
        return
    for point in branch.points[1:]:
        if id(point) not in solved:
            continue
        z = solved[id(point)].z
        size = np.ptp([orbits.state_after(z, part / _PARTS) for part in range(1, _PARTS)], axis=0).max()
        for k in (2, 3, 5):
            off = float(np.abs(orbits.state_after(z, 1.0 / k) - z[: orbits.n]).max())
            if off < 1e-8 and off < 1e-5 * size:
                found.fault("period", f"at {point.value!r} the orbit is back after {1 / k:.3f} of its period")
        return


def _segments(found: Verdict, orbits: Orbits, asked: Drawn, branch: Any, solved: dict[int, Solved]) -> None:
    """All special points between ordinary ones, by both programs."""
    points, last, between = branch.points, None, []
    for number, point in enumerate(points):
        if point.special is not None and number:
            between.append(point)
            continue
        if last is not None:
            _segment(found, orbits, asked, branch, last, point, between, solved)
        last, between = point, []
    for point in between:
        found.own.append(f"{point.special.label} at {point.value!r} ends the branch")


def _segment(
    found: Verdict,
    orbits: Orbits,
    asked: Drawn,
    branch: Any,
    first: Any,
    last: Any,
    between: list[Any],
    solved: dict[int, Solved],
) -> None:
    leaving = first.special is not None
    if id(last) not in solved or not (leaving or id(first) in solved):
        found.counts["unchecked points"] += len(between)
        return
    start = orbits.z(first.orbit, first.value, first.period) if leaving else solved[id(first)].z
    if leaving and orbits.free and abs(start[-1] / solved[id(last)].z[-1] - 1.0) > 0.4:
        start[-1] *= round(solved[id(last)].z[-1] / start[-1])
    segment = Segment(orbits, start, solved[id(last)].z)
    stated = [orbits.z(each.orbit, each.value, each.period) for each in between]
    places = [float((z - segment.start)[: orbits.n + 1] @ segment.normal) / segment.length for z in stated]
    try:
        segment.foresee(not leaving)
        own = segment.crossings(places, _SPECIAL if leaving else 0.0)
    except (NoOrbit, ValueError, np.linalg.LinAlgError) as reason:
        found.counts["unchecked points"] += len(between)
        found.own.append(f"between {first.value!r} and {last.value!r}: {reason}")
        return
    _compared(found, orbits, branch, segment, own, list(zip(between, places, strict=True)))


def _compared(
    found: Verdict,
    orbits: Orbits,
    branch: Any,
    segment: Segment,
    own: list[Crossing],
    stated: list[tuple[Any, float]],
) -> None:
    """Each crossing with the point that is nearest along the curve, of its kind if there is one."""
    rest = list(own)
    for point, place in stated:
        test = _TESTS.get(point.special.label, 0)
        if point.special.label == "collision":
            test = int(point.bifurcation.multiplier.real < 0.0)
        near = sorted(rest, key=lambda each: (each.test != test, abs(each.place - place)))
        if point.bifurcation is None or not np.isfinite(point.bifurcation.error_bound):
            found.gap(f"{point.special.label} at {point.value!r} has no bound")
            rest = [each for each in rest if not near or each is not near[0]]
            continue
        bound = point.bifurcation.error_bound
        # Where an orbit is met at another instant its place is another, but not its value.
        near.sort(key=lambda each: abs(each.value - point.value) > bound + 3.0 * each.error or each.test != test)
        agrees = bool(near) and abs(near[0].value - point.value) <= bound + 3.0 * near[0].error and near[0].test == test
        if not near or (abs(near[0].place - place) > 0.05 and not agrees):
            if _touches(found, segment, point, place, test):
                continue
            found.fault("not there", f"{point.special.label} at {point.value!r} ± {point.bifurcation.error_bound:.1e}")
            continue
        mine = near[0]
        rest.remove(mine)
        if test == 0:
            turns, (mine, rest) = mine.fold and point.special.label != "fold", at_once(mine, rest, bound)
            if turns and mine.fold and _touches(found, segment, point, place, test):
                continue
        multiple = point.bifurcation.multiplicity > (2 if test == 2 else 1)
        if multiple:  # which cross at one place
            rest = [each for each in rest if abs(each.place - mine.place) > 1e-3]
        off = abs(mine.value - point.value)
        if mine.test != test and not branch.symmetric and not multiple:
            found.fault("kind", f"{point.special.label} at {point.value!r} is test {mine.test}")
        elif mine.fold != (point.special.label == "fold") and test == 0 and not multiple:
            found.fault("kind", f"{point.special.label} at {point.value!r}: the curve turns there: {mine.fold}")
        elif off > bound + 3.0 * mine.error + _ROUNDING * abs(mine.value):
            found.fault(
                "off", f"{point.special.label} at {point.value!r} ± {bound:.1e} is at {mine.value!r} ± {mine.error:.1e}"
            )
        else:
            found.counts["confirmed"] += 1
            found.counts["loose"] += bool(mine.error > 1e-6 * orbits.scale)
    for each in rest:
        if each.error > _VAGUE * abs(orbits.value(segment.end - segment.start)):
            found.own.append(f"a crossing at {each.value!r} is uncertain by {each.error:.1e}")
            continue
        if _on_either(segment, each, stated):
            continue
        remark = _remark(branch, orbits, segment, each)
        name = ("+1", "-1", "pair")[each.test]
        if remark:
            found.gap(f"{name} at {each.value!r}: {remark}")
        else:
            found.fault("missed", f"{name} at {each.value!r} ± {each.error:.1e}, fold {each.fold}")


def at_once(mine: Crossing, rest: list[Crossing], bound: float) -> tuple[Crossing, list[Crossing]]:
    """The crossing that a point at +1 is, and the others without those at its value within their errors: a branch that
    turns in the pitchfork where it leaves another one has a fold and a crossing there, or a multiplier that touches 1
    and is seen as two; an orbit exactly at a fold is one in two segments."""
    twins = [
        each
        for each in rest
        if each.test == 0
        and (mine.fold or each.fold)
        and abs(each.value - mine.value) <= bound + 3.0 * (each.error + mine.error)
    ]
    other = [each for each in twins if each.fold != mine.fold]
    return (other[0] if other and mine.fold else mine), [each for each in rest if each not in twins]


def _turn(segment: Segment, place: float) -> float:
    """Place nearby where the curve turns: the value of a point tells its place badly there. Orbits on both sides of a
    guess give the next one, never the guess itself, where another curve may pass in another direction."""
    n, at, side = segment.orbits.n, place, 0.01
    try:
        for _ in range(10):
            before, after = (segment.at(at + each).tangent[n] for each in (-side, side))
            if before == after:
                return place
            moved = side * (before + after) / (before - after)
            at += moved
            if abs(at - place) > 0.2:
                return place
            if abs(moved) < 1e-4:
                break
    except NoOrbit:
        return place
    return at


def _touches(found: Verdict, segment: Segment, point: Any, place: float, test: int) -> bool:
    """Whether a test function touches zero there; compares the values."""
    touch = _touch(segment, point, place, test)
    if touch is None:
        return False
    _, value, wrong = touch
    if abs(value - point.value) > point.bifurcation.error_bound + wrong:
        found.fault("off", f"{point.special.label} at {point.value!r}: it is at {value!r}")
    else:
        found.counts["confirmed"] += 1
    return True


def _touch(segment: Segment, point: Any, place: float, test: int) -> tuple[float, float, float] | None:
    """Place where a test function touches zero, the parameter there and its error, by one of three causes: two
    multipliers cross at once; two meet at +1 or -1 and stay on the circle; or one comes to +1 and goes back where the
    curve turns, on a branch that goes through the point where it leaves another one."""
    double = point.bifurcation.multiplicity == 2 and test < 2
    if test and not double:
        return None
    places, values, n, target = [], [], segment.orbits.n, (1.0, -1.0, 0.0)[test]
    place = place if double else _turn(segment, place)
    for width in (_TOUCHED, 3.0 * _TOUCHED):
        sides = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0]) * width
        try:
            nodes = [segment.at(place + side) for side in sides]
        except NoOrbit:
            return None
        near = [np.sort(np.abs(node.multipliers - target))[int(double)] for node in nodes]
        if max(near) > 0.1 or (not double and nodes[0].tangent[n] * nodes[-1].tangent[n] > 0.0):
            return None
        course = np.polynomial.Polynomial.fit(sides, [segment.orbits.value(node.z) for node in nodes], 5)
        vanishing = course.deriv()
        if double:
            pairs = [node.multipliers[np.argsort(np.abs(node.multipliers - target))[:2]] for node in nodes]
            vanishing = np.polynomial.Polynomial.fit(sides, [pair.mean().real - target for pair in pairs], 5)
        zeros = real_roots(vanishing, 3 * width)
        if double and not zeros:
            zeros = [zero for zero in real_roots(vanishing.deriv(), 3 * width) if abs(vanishing(zero)) < 1e-5]
        if not zeros:
            return None
        places.append(place + min(zeros, key=abs))
        values.append(float(course(places[-1] - place)))
    # Orbits so near a point where branches meet are uncertain; what two widths differ by tells how much.
    return places[1], values[1], 3.0 * abs(values[1] - values[0])


def _on_either(segment: Segment, crossing: Crossing, stated: list[tuple[Any, float]]) -> bool:
    """True for a crossing at +1 beside a stated one where branches meet: orbits there lie on either of them."""
    if crossing.test:
        return False
    touches = (_touch(segment, *each, 0) for each in stated if abs(each[1] - crossing.place) < _NEAR)
    return any(touch is not None and abs(touch[0] - crossing.place) < _TOUCHED for touch in touches)


def _remark(branch: Any, orbits: Orbits, segment: Segment, crossing: Crossing) -> str:
    """A remark that names a value in the same step."""
    ends = orbits.value(segment.start), orbits.value(segment.end)
    low, high = min(*ends, crossing.value), max(*ends, crossing.value)
    slack = 1e-5 * max(abs(low), abs(high))
    for remark in branch.remarks:
        for number in re.findall(r"-?\d+\.?\d*(?:e[+-]?\d+)?", remark):
            if low - slack <= float(number) <= high + slack:
                return str(remark)
    return ""


def _end(found: Verdict, orbits: Orbits, asked: Drawn, branch: Any, solved: dict[int, Solved]) -> None:
    """Whether a branch ended as it says."""
    last, first, name = branch.points[-1], branch.points[0], branch.ending.name
    found.counts[f"end {name.lower()}"] += 1
    for remark in branch.remarks:
        found.gap(f"remark: {remark}")
    inside = [asked.between[0] <= point.value <= asked.between[1] for point in branch.points]
    if not all(inside):
        found.fault("end", "a point is outside the interval")
    if name == "LEFT_INTERVAL" and last.value not in asked.between:
        found.fault("end", f"it says that it left the interval, at {last.value!r}")
    elif name == "CLOSED":
        mine = solved.get(id(last))
        if mine is None:
            found.own.append("the end of a closed branch")
            return
        start = orbits.z(first.orbit, first.value, first.period)
        # Where the end is a bifurcation, this program knows it to the root of its accuracy only.
        z = mine.z if orbits.free else orbits.z(last.orbit, last.value, last.period)
        along = [np.append(orbits.state_after(z, part / 256), z[orbits.n]) for part in range(257)]
        off = min(float(np.abs(each - start[: orbits.n + 1]).max()) for each in along[: None if orbits.free else 1])
        if off > (0.05 if orbits.free else 1e-6):
            found.fault("end", f"it says that it closed, {off:.1e} from its start")
    elif name == "LOST" and "Hopf" in branch.reason:
        sizes = [_motion(orbits, solved[id(p)].z) for p in branch.points if id(p) in solved]
        if not sizes or sizes[-1] > 0.2 * max(sizes):
            found.fault("end", f"no small cycle: {sizes[-1:]} of {max(sizes, default=0.0):.2g}")
    elif name in ("LOST", "BUDGET"):
        found.gap(f"{name.lower()} at {last.value!r}: {branch.reason}")


def _motion(orbits: Orbits, z: Array) -> float:
    return float(np.ptp([orbits.state_after(z, part / _PARTS) for part in range(1, _PARTS)], axis=0).max())
