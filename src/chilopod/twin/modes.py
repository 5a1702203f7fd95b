"""Results of the multipliers of a walk in MuJoCo: modes, verdict, table and drawing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays
from chilopod.notebook import Summary, axes_for
from chilopod.stability.spectrum.eigenvalues import VERDICTS, stable_within

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class CycleMode(ReadOnlyArrays):
    """A mode of a walk.

    Attributes
    ----------
    multiplier, error
        Multiplier over one gait cycle, and a bound on its absolute error or half its interval of 95 %.
    angles
        Yaw joints of the mode, front to rear, (N-1,); the largest is 1.
    period
        Period of the gait, s.
    """

    multiplier: complex
    error: float
    angles: ComplexArray
    period: float

    @property
    def shape(self) -> str:
        """``bend`` if all yaw joints turn to one side at a time, ``undulation`` if not, ``other`` if none turns."""
        if not self.angles.any():
            return "other"
        turned = self.angles * np.conj(self.angles.sum())
        return "bend" if (turned.real > 0.0).all() else "undulation"

    @property
    def frequency(self) -> float:
        """Angular frequency, rad/s."""
        return abs(float(np.angle(self.multiplier))) / self.period

    def as_json(self) -> dict[str, Any]:
        """The mode as plain numbers."""
        return {
            "multiplier": [self.multiplier.real, self.multiplier.imag],
            "error": self.error if math.isfinite(self.error) else None,
            "shape": self.shape,
            "frequency_rad_s": self.frequency,
            "joint_components": [[angle.real, angle.imag] for angle in self.angles.tolist()],
        }

    def cells(self, which: str) -> Sequence[str]:
        """A row of the table."""
        value, turns = self.multiplier, abs(float(np.angle(self.multiplier))) / (2.0 * math.pi)
        shown = f"{value.real:.6f}" + (f" ± {abs(value.imag):.6f}i" if value.imag else "")
        shape = f"{self.shape} of {1.0 / turns:.3g} cycles" if turns else self.shape
        angles = "  ".join(f"{a.real:.2f}" + (f"{a.imag:+.2f}i" if value.imag else "") for a in self.angles)
        return which, shown, f"{self.error:.1e}", f"{abs(value):.6f}", shape, angles


@dataclass(frozen=True)
class CycleMultipliers(Summary, ReadOnlyArrays):
    """Leading multipliers and modes of a walk in MuJoCo.

    Attributes
    ----------
    name
        Name of the robot.
    state, mismatch
        Coordinates at the start of the cycle, see :class:`CycleMap`, and their largest change over one.
    exact
        Leading modes of the derivative, by falling modulus; empty if the walk does not close.
    reach
        Largest bend along them that changes no contact, rad; NaN if the walk does not close.
    amplitude, finite
        Size of bends, rad, and their modes.
    spread
        Range of each yaw joint at the start of consecutive cycles, rad, (N-1,).
    contacts
        Contacts that such bends change, or that change from cycle to cycle, a phrase each.
    """

    name: str
    state: Array
    mismatch: float
    exact: tuple[CycleMode, ...]
    reach: float
    amplitude: float
    finite: tuple[CycleMode, ...]
    spread: Array
    contacts: tuple[str, ...]

    @property
    def stable(self) -> bool | None:
        """Stability by the derivative, or without one by bends of finite size; None where errors leave it undecided."""
        modes = self.exact or self.finite
        errors = np.array([mode.error for mode in modes])
        return stable_within(np.array([mode.multiplier for mode in modes]), float(errors.max()), errors)

    @property
    def title(self) -> str:
        """Verdict in words."""
        return f"{self.name}: the straight walk of the twin is {VERDICTS[self.stable]}"

    def as_json(self) -> dict[str, Any]:
        """The result as plain numbers; complex ones as [real, imaginary]."""
        return {
            "robot": self.name,
            "engine": "twin",
            "period_s": self.finite[0].period,
            "stable": self.stable,
            "verdict": VERDICTS[self.stable],
            "closes": bool(self.exact),
            "mismatch": self.mismatch,
            "multipliers": [mode.as_json() for mode in self.exact],
            "reach_rad": self.reach if self.exact else None,
            "amplitude_rad": self.amplitude,
            "multipliers_of_amplitude": [mode.as_json() for mode in self.finite],
            "spread_rad": self.spread.tolist(),
            "contacts": list(self.contacts),
        }

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        size = f"{math.degrees(self.amplitude):.3g}°"
        rows: list[Sequence[str]] = [("bends", "multiplier", "error", "modulus", "shape", "yaw joints, front to rear")]
        rows += [mode.cells("smallest") for mode in self.exact] + [mode.cells(size) for mode in self.finite]
        changed = ", ".join(self.contacts) or "none found"
        if self.exact:
            below = [
                f"The walk closes to {self.mismatch:.0e} in a cycle. The derivative holds for bends up to about "
                f"{math.degrees(self.reach):.1g}°, beyond which contacts change: {changed}."
            ]
        else:
            below = [
                f"The walk does not close: a cycle changes it by {self.mismatch:.0e}, yaw joints scatter over "
                f"{math.degrees(self.spread.max()):.2g}°, and it has no derivative.",
                f"Contacts that change from cycle to cycle: {changed}.",
            ]
        return [], rows, below

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the multipliers beside the unit circle: of smallest bends as discs, of finite ones as crosses."""
        axes, around = axes_for(axes), np.linspace(0.0, 2.0 * np.pi, 361)
        axes.plot(np.cos(around), np.sin(around), color="grey", linewidth=1.0)
        for style, modes in (("C0o", self.exact), ("C3x", self.finite)):
            values = np.array([mode.multiplier for mode in modes])
            axes.plot(values.real, values.imag, style)
        axes.set(xlabel="real part", ylabel="imaginary part", aspect="equal", title=self.title)
        return axes
