"""Results of the multipliers of a walk in MuJoCo: modes, verdict, table and drawing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.notebook import Summary, axes_for
from chilopod.stability.shown import number
from chilopod.stability.spectrum import VERDICTS, stable_within

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class CycleMode(ReadOnlyArrays):
    """A mode of a walk: its multiplier over one gait cycle, its error (for bends of a given size an estimate), and its
    yaw joints, front to rear, (N-1,), of which the largest is 1 (all are 0 if none turns)."""

    multiplier: complex
    error: float
    angles: ComplexArray

    @property
    def _seen(self) -> tuple[complex, ComplexArray]:
        """Multiplier and joints; if the error leaves open that a pair turns, the real multiplier that counts twice."""
        if abs(self.multiplier.imag) > self.error:
            return self.multiplier, self.angles
        return complex(self.multiplier.real), self.angles.real.astype(np.complex128)

    @property
    def turn(self) -> float:
        """Angle by which the mode turns in a cycle, rad; 0 where the error leaves it open."""
        value, _ = self._seen
        return abs(float(np.angle(value))) if abs(value) > self.error else 0.0

    @property
    def shape(self) -> str:
        """``bend`` if all yaw joints turn to one side at a time, ``undulation`` if not, ``other`` if none turns."""
        _, angles = self._seen
        turned = angles * np.conj(angles.sum())
        return ("bend" if (turned.real > 0.0).all() else "undulation") if angles.any() else "other"

    def as_json(self, period: float) -> dict[str, Any]:
        """The mode as plain numbers, for a period of the gait in s."""
        return {
            "multiplier": [self.multiplier.real, self.multiplier.imag],
            "error": self.error if math.isfinite(self.error) else None,
            "shape": self.shape,
            "frequency_rad_s": self.turn / period,
            "joint_components": [[angle.real, angle.imag] for angle in self.angles.tolist()],
        }

    def cells(self, which: str) -> Sequence[str]:
        """A row of the table."""
        (value, joints), turn = self._seen, self.turn
        shown = number(value, 6).replace("+", " ± ") + " twice" * (value != self.multiplier)
        shape = self.shape + (f" of {2.0 * math.pi / turn:.3g} cycles" if turn else "")
        angles = "  ".join(number(angle, 2) for angle in np.round(joints, 12).tolist())
        return which, shown, f"{self.error:.1e}", f"{abs(value):.6f}", shape, angles


_GROWTH = {True: "decay", False: "grow", None: "neither decay nor grow for certain"}


def _verdict(modes: Sequence[CycleMode]) -> bool | None:
    """True if all modes decay, False if one grows, None where errors leave it undecided or there are none."""
    return stable_within(np.array([m.multiplier for m in modes]), np.array([m.error for m in modes])) if modes else None


@dataclass(frozen=True, eq=False)
class CycleMultipliers(Summary, ReadOnlyArrays):
    """Leading multipliers and modes of a walk in MuJoCo."""

    name: str
    period: float  # of the gait, s
    state: Array  # coordinates at the start of a cycle, see CycleMap
    mismatch: float  # largest change of a coordinate over a cycle
    exact: tuple[CycleMode, ...]  # modes of the derivative, by falling modulus; none if the walk does not close
    reach: float | None  # largest bend along them that changes no contact
    amplitude: float  # size of finite bends
    finite: tuple[CycleMode, ...]  # modes of bends of that size
    spread: Array  # range of each bend at the start of consecutive cycles, (N-1,)
    contacts: tuple[str, ...]  # those that a larger bend than the reach changes, or that differ between cycles
    unit: str = "rad"  # unit of bends: rad (shown in degrees), m, rad/s, m/s, or "" if they differ
    heading: bool = False  # whether the motion depends on the heading, which is divided out
    switch: bool = False  # whether the motion repeats, but lies on the switch of a contact, limit or slack spring
    given_way: tuple[str, float] | None = None  # joint that bends most and its mean, if the straight walk does not hold

    @property
    def stable(self) -> bool | None:
        """Stability of the periodic motion by the derivative; None without one, or where errors leave it undecided.
        False where the straight walk has given way."""
        return False if self.given_way else _verdict(self.exact)

    @property
    def title(self) -> str:
        """Verdict in words, without a derivative on bends of finite size."""
        if self.given_way:
            joint, mean = self.given_way
            bend = f"{joint} = {self._shown(mean, 2)} in the mean"
            return f"{self.name}: the straight walk has given way: it bends ({bend})"
        if self.exact:
            return f"{self.name}: the periodic motion is {VERDICTS[self.stable]}"
        size = self._shown(self.amplitude, 3)
        why = "the periodic motion has no derivative" if self.switch else "no periodic motion was found from this start"
        return f"{self.name}: bends of {size} {_GROWTH[_verdict(self.finite)]}; {why}"

    def as_json(self) -> dict[str, Any]:
        """The result as plain numbers; complex ones as [real, imaginary]."""
        return {
            "robot": self.name,
            "engine": "twin",
            "period_s": self.period,
            "stable": self.stable,
            "verdict": VERDICTS[self.stable],
            "closes": bool(self.exact) or self.switch,
            "mismatch": self.mismatch,
            "multipliers": [mode.as_json(self.period) for mode in self.exact],
            "reach_rad": self.reach,
            "amplitude_rad": self.amplitude,
            "multipliers_of_amplitude": [mode.as_json(self.period) for mode in self.finite],
            "spread_rad": self.spread.tolist(),
            "contacts": list(self.contacts),
            "given_way": dict(zip(("joint", "mean_rad"), self.given_way, strict=True)) if self.given_way else None,
        }

    def _shown(self, bend: float, digits: int) -> str:
        """A bend in words."""
        if self.unit == "rad":
            return f"{float(f'{math.degrees(bend):.{digits}g}'):g}°"
        return f"{bend:.{digits}g} {self.unit}".rstrip()

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        size = self._shown(self.amplitude, 3)
        head = ("bends", "multiplier", "error", "modulus", "shape", "joints")
        rows = [mode.cells("smallest") for mode in self.exact] + [mode.cells(size) for mode in self.finite]
        closes = f"The walk changes by {self.mismatch:.0e} in a cycle"
        if self.switch:
            said = f"{closes} and lies on a switch, where there is no derivative. Contacts and limits that switch"
        elif self.reach is None:
            scatter = f"bends scatter over {self._shown(float(self.spread.max()), 2)}"
            said = f"{closes}, and {scatter}. Contacts that change from cycle to cycle"
        else:
            bends = any(mode.angles.any() for mode in self.exact)  # or else reach is that of their largest coordinate
            what, size = ("bend", self._shown(self.reach, 1)) if bends else ("move", f"{self.reach:.1g}")
            said = f"{closes}. No {what} along these modes, up to about {size}, changes a contact"
            said += "; larger ones do" if self.contacts else ""
        contacts = f": {', '.join(self.contacts) or 'none found'}." if self.contacts or self.reach is None else "."
        return [], [head, *rows], [said + contacts, *self._remarks(size)]

    def _remarks(self, size: str) -> list[str]:
        """Sentences about a bent walk, bends of the size, in words, that differ from smallest ones, and the heading."""
        remarks = ["The multipliers are those of the bent walk."] if self.given_way else []
        if not self.finite:
            remarks += [f"With bends of {size} the walk falls, or they grow too far: only smallest ones are shown."]
        elif self.stable and any(abs(mode.multiplier) > 1.0 + mode.error for mode in self.finite):
            remarks += [f"Bends of {size} grow, although the smallest ones decay."]
        if self.heading:
            remarks += ["The motion depends on the heading, as with pyramidal cones of friction: this is for one."]
        return remarks

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the multipliers beside the unit circle: of smallest bends as discs, of finite ones as crosses."""
        axes, around = axes_for(axes), np.linspace(0.0, 2.0 * np.pi, 361)
        axes.plot(np.cos(around), np.sin(around), color="grey", linewidth=1.0)
        for style, modes in (("C0o", self.exact), ("C3x", self.finite)):
            values = np.array([mode.multiplier for mode in modes])
            axes.plot(values.real, values.imag, style)
        axes.set(xlabel="real part", ylabel="imaginary part", aspect="equal", title=self.title)
        return axes
