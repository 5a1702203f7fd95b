"""Challenges of the page: each says what to do, and finds out whether it was done."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.engine import Status
from chilopod.live import wishes
from chilopod.live.state import Seen
from chilopod.live.theory import Theory
from chilopod.live.words import spring_text
from chilopod.steering import ARRIVAL_RADIUS

_NEAR = 0.5  # N·mm/deg
_BEARING, _DISTANCE = math.radians(60.0), 1.2  # of the pole, m
_BENT, _STEADY = 1.0, 0.1  # rad of bend, and its change a second as a share of it, of a curve that has settled


class Challenge:
    """A task for the user of the page, who may do with the robot all that the page offers."""

    name: ClassVar[str]
    task: ClassVar[str]
    answers: ClassVar[Sequence[str]] = ()
    hides: ClassVar[bool] = False  #: True if the pitchfork must not be shown until it is done
    done, said = False, ""

    def begin(self, seen: Seen) -> wishes.Wish | None:
        """Wish that sets the challenge up."""
        return None

    def look(self, seen: Seen) -> None:
        """Follow the walk."""

    def answer(self, given: str, seen: Seen, theory: Theory) -> None:
        """Judge one of the answers."""

    @property
    def asks(self) -> bool:
        """True while an answer is wanted."""
        return bool(self.answers) and not self.done


class Onset(Challenge):
    """Find the pitchfork by watching."""

    name = "find the onset"
    task = (
        "Find the first spring at which the straight walk becomes unstable, to 0.5 N·mm/deg. The pitchfork is hidden. "
        "Set the spring, watch, and press the button when you are sure."
    )
    answers = ("The onset is at this spring",)
    hides = True

    def answer(self, given: str, seen: Seen, theory: Theory) -> None:
        if theory.pitchfork is None:
            self.said = f"The onset of this robot is not known: {theory.remark or 'nothing was computed'}."
            return
        off = units.from_si(float(seen.stiffness[0]) - theory.pitchfork, PAPER_UNIT)
        self.done = abs(off) <= _NEAR
        no = f"Not yet: the onset is at a {'softer' if off > 0.0 else 'stiffer'} spring."
        self.said = f"Done: the pitchfork is at {spring_text(theory.pitchfork)}." if self.done else no


class Pole(Challenge):
    """Reach a place by changing the first spring alone."""

    name = "reach the pole by the spring"
    task = (
        "Lead module 1 to the green pole with the slider of the first spring alone: no strategy, no pull at a joint. "
        "You cannot choose the side, but every circle comes round."
    )
    _place: tuple[float, float] | None = None  #: None for a robot that has stopped

    def begin(self, seen: Seen) -> wishes.Wish | None:
        if seen.status is not Status.WALKED:
            self.said = "The robot has stopped. Press R, and choose the challenge again."
            return None
        x, y, heading = (float(each) for each in seen.pose)
        way = heading + _BEARING
        self._place = x + _DISTANCE * math.cos(way), y + _DISTANCE * math.sin(way)
        self._pulled = self._aimed = False
        return wishes.Target(self._place, by_hand=True)

    def look(self, seen: Seen) -> None:
        if self.done or self._place is None:
            return
        away = math.hypot(seen.pose[0] - self._place[0], seen.pose[1] - self._place[1])
        self._pulled |= bool(seen.pulled.any())
        here = seen.target == self._place and not seen.steering
        self._aimed |= here
        if self._pulled:
            self.said = "A joint was pulled, which does not count. Choose the challenge again."
        elif self._aimed and away < 1.1 * ARRIVAL_RADIUS:
            self.done, self.said = True, "Done: the spring alone has led the robot to the pole."
        elif self._aimed and not here:
            self.said = "The pole is gone. Choose the challenge again."
        else:
            self.said = f"{away:.2f} m to the pole."


class Left(Challenge):
    """Turn left twice in a row, and say why nobody can choose."""

    name = "turn left twice in a row"
    task = (
        "Press R for the next seed, soften the first spring and let the bend settle, without a pull or a target. Do so "
        "until the robot has turned left twice in a row. Then say why you cannot choose the side."
    )
    answers = ("The gait prefers one side", "The spring decides", "The sides are alike: chance decides")

    _row, _time, _counts = 0, math.inf, False

    def look(self, seen: Seen) -> None:
        if self.done or self._row == 2:
            return
        if seen.time < self._time:  # it has begun anew
            self._counts = seen.bend < _BENT
        self._time = seen.time
        if seen.pulled.any() or seen.target is not None:
            self._counts = False
        elif self._counts and seen.bend > _BENT and abs(seen.turning) < _STEADY * seen.bend:
            left = seen.mean_angles.sum() < 0.0
            self._row, self._counts = self._row + 1 if left else 0, False
        now = "Let it bend and settle." if self._counts else "Press R for the next attempt."
        self.said = "Twice left. Why can you not choose?" if self._row == 2 else f"{self._row} of 2 in a row. {now}"

    @property
    def asks(self) -> bool:
        return self._row == 2 and not self.done

    def answer(self, given: str, seen: Seen, theory: Theory) -> None:
        self.done, no = given == self.answers[-1], "No: compare two seeds with the same spring and the same gait."
        yes = "Done: both branches are mirror images, and the smallest disturbance chooses between them."
        self.said = yes if self.done else no


CHALLENGES = {each.name: each for each in (Onset, Pole, Left)}
