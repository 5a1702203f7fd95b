"""Undulating walks, which replace the straight walk when all springs are softened together.

At the Neimark-Sacker point a pair of multipliers leaves the unit circle and the body begins to swing at a second
frequency. The nonlinear model runs until the undulation has settled, for several springs below the point. The result is
compared with the normal form: the amplitude grows as the square root of the distance, and the frequency changes in
proportion to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod import units
from chilopod.analysis.parameters import ALL, PAPER_UNIT
from chilopod.analysis.straight_walk import first_loss
from chilopod.errors import AnalysisError, ParameterError
from chilopod.frozen import Array, ComplexArray
from chilopod.planar.along import FollowedModel
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import BifurcationPoint, Criticality, Kind
from chilopod.stability.returns import return_map, whole_period
from chilopod.stability.spectrum import spectrum

DISTANCES = (0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16)
"""Default distances 1 - k/k* of the springs."""

TOLERANCE = 1e-8
"""Tolerance of the nonlinear flow; orbits are accurate to about a tenth of it, and the amplitude is a few degrees."""

_SETTLING = 6.0  # e-folds of the slowest disturbance, that of the amplitude
_MEASURED = 1000  # periods
_LONGEST = 100_000  # periods until all have settled


def undulating_walks(robot: Robot, distances: Sequence[float] = DISTANCES, progress: Progress = silent) -> xr.Dataset:
    """Amplitude and frequency of the settled undulation below the Neimark-Sacker point of uniform springs.

    AnalysisError if there is no Neimark-Sacker point, if it is not supercritical, so that no small undulation exists,
    or if a motion diverges; ParameterError if a distance is not between 0 and 1.

    Parameters
    ----------
    robot, distances
        Robot, whose springs do not matter; 1 - k/k* of the springs, each above 0 and below 1.

    Returns
    -------
    Dataset over distance: the spring ``k``, ``growth`` of a small undulation (1/s), ``amplitude`` (rad; the norm over
    the joints, so that joint j swings by amplitude times ``component``), ``frequency`` (rad/s), both also as
    ``predicted_amplitude`` and ``predicted_frequency``; ``linear_frequency``, that of a small undulation;
    ``largest_angle`` of any joint (rad); and ``swing`` over (distance, joint), the measured share of every joint at
    the second frequency (rad). ``component`` over joint has unit norm. The point is in the attributes.
    """
    for distance in distances:
        if not 0.0 < distance < 1.0:
            raise ParameterError("must be more than 0 and less than 1", field="distances", value=distance)
    loss = first_loss(robot, ALL, None, Kind.NEIMARK_SACKER)
    point = loss.point
    if point.criticality is not Criticality.SUPERCRITICAL:
        raise AnalysisError("must be supercritical for an undulation to grow from it", field="Neimark-Sacker point")
    ks = [point.value * (1.0 - distance) for distance in distances]
    models = [FollowedModel(robot.with_value(ALL, k), TOLERANCE) for k in ks]
    expected = [_expected(model, point) for model in models]
    projected, states = _settled(models, expected, progress)
    measured = [_measured(row) for row in projected]
    joints = slice(3, robot.body.modules + 2)
    share = np.array([np.linalg.norm(each.mode[joints]) for each in expected])
    turned = (np.exp(-1j * turn * np.arange(_MEASURED))[:, None] for _, turn in measured)
    pairs = zip(states, turned, strict=True)
    swing = np.array([2.0 * np.abs(_average(state[:, joints] * each)) for state, each in pairs])
    period = robot.gait.period
    component = np.abs(point.mode[joints])

    def column(values: object, what: str) -> tuple[tuple[str, ...], Array, dict[str, str]]:
        return ("distance",), np.asarray(values, dtype=np.float64), {"units": what}

    return xr.Dataset(
        {
            "k": column([units.from_si(k, PAPER_UNIT) for k in ks], PAPER_UNIT),
            "growth": column([np.log(abs(each.multiplier)) / period for each in expected], "1/s"),
            "amplitude": column(2.0 * share * [size for size, _ in measured], "rad"),
            "predicted_amplitude": column(2.0 * share * [each.amplitude for each in expected], "rad"),
            "frequency": column([turn / period for _, turn in measured], "rad/s"),
            "predicted_frequency": column([each.turn / period for each in expected], "rad/s"),
            "linear_frequency": column([np.angle(each.multiplier) / period for each in expected], "rad/s"),
            "largest_angle": column(np.abs(states[..., joints]).max(axis=(1, 2)), "rad"),
            "swing": (("distance", "joint"), swing, {"units": "rad"}),
            "component": (("joint",), component / np.linalg.norm(component)),
        },
        coords={"distance": ("distance", np.asarray(distances)), "joint": np.arange(1, robot.body.modules)},
        attrs={
            "robot": robot.name,
            "varied": ALL,
            "value": loss.value,
            "unit": loss.unit,
            "frequency_rad_s": point.frequency,
            "criticality": point.criticality.label,
            "coefficient": loss.coefficient,
            "about": "the settled undulation below the Neimark-Sacker point of uniform springs",
        },
    )


@dataclass(frozen=True)
class _Expected:
    """Normal form at a spring: fixed radius and turn per period, and the mode along which they are measured."""

    orbit: Array
    multiplier: complex
    mode: ComplexArray
    left: ComplexArray
    amplitude: float
    turn: float


def _expected(model: FollowedModel, point: BifurcationPoint) -> _Expected:
    """|a| -> |mu| |a| + c |a|^3 keeps |a|^2 = (1 - |mu|) / c and turns by arg mu + d |a|^2."""
    assert point.coefficient is not None
    assert point.rotation is not None
    orbit = model.orbit
    spec = spectrum(return_map(whole_period(model), orbit, with_error=False))
    critical = np.exp(1j * point.frequency * model.period)
    index = int(np.abs(spec.values - critical).argmin())
    mu = complex(spec.values[index])
    square = (1.0 - abs(mu)) / point.coefficient
    if not square > 0.0:
        raise AnalysisError("the straight walk must be unstable for an undulation to grow", field=ALL)
    turn = float(np.angle(mu)) + point.rotation * square
    return _Expected(orbit, mu, spec.right[:, index], spec.left[:, index], float(np.sqrt(square)), turn)


def _settled(models: list[FollowedModel], expected: list[_Expected], progress: Progress) -> tuple[ComplexArray, Array]:
    """Amplitudes along the critical mode, shape (robots, periods), and states, shape (robots, periods, 2N+1), of all
    robots, period by period, after the predicted undulation has settled."""
    period = models[0].period
    states = np.array([each.orbit + 2.0 * (each.amplitude * each.mode).real for each in expected])
    # Near the torus a disturbance of the radius dies out twice as fast as one of the straight walk grows.
    slowest = min(2.0 * np.log(abs(each.multiplier)) for each in expected)
    settling = int(np.ceil(_SETTLING / slowest))
    if settling > _LONGEST:
        raise AnalysisError("must be larger: near the point the undulation settles too slowly", field="distances")
    recorded = np.empty((len(models), _MEASURED, models[0].dimension))
    for count in range(-settling, _MEASURED):
        if count >= 0:
            recorded[:, count] = states
        states = FollowedModel.flow_each(models, states, 0.0, period)
        if count % 100 == 0:
            progress((count + settling) / (settling + _MEASURED), "until the undulation has settled")
    pairs = zip(recorded, expected, strict=True)
    return np.array([(rows - each.orbit) @ each.left.conj() for rows, each in pairs]), recorded


def _measured(projected: ComplexArray) -> tuple[float, float]:
    """Amplitude of the first harmonic, and the turn per period."""
    turn = float(_average(np.angle(projected[1:] / projected[:-1])))
    return float(np.abs(_average(projected * np.exp(-1j * turn * np.arange(projected.size))))), turn


def _average(values: NDArray[np.inexact]) -> NDArray[np.inexact]:
    """Mean along the first axis with a weight that falls smoothly to zero at both ends: over a quasi-periodic motion
    it converges faster than any power of the number of values (Das et al., Nonlinearity 30, 2017)."""
    t = (np.arange(len(values)) + 1.0) / (len(values) + 1.0)
    weight = np.exp(-1.0 / (t * (1.0 - t)))
    return np.asarray(np.tensordot(weight / weight.sum(), values, axes=1))
