"""Integration in steps of some milliseconds as good as in small ones: the servos' dampers by the trapezoidal rule.

A servo's damping over its joint's inertia is a rate of hundreds per second, too fast for an explicit step of 2 ms.
MuJoCo's own implicit integrators take the damper at the end of the step, I (w' - w) = h (M - D w'), and so act as if
the joint had h D / 2 more inertia than it has; and they compute contact forces as if there were no damper. Both errors
go with the step, and with legs as overdamped as this robot's they are not small: at 2 ms a curve was 10 % too tight.

The trapezoidal rule takes the damper at the mean of both rates. Solved for w', that is an *explicit* step of a joint
with h D / 2 more inertia, (I + h D / 2) (w' - w) = h (M - D w). Therefore h D / 2 is added to the joints
(``armature``), and the explicit integrator does the rest: of second order, stable at every damping, and consistent with
the contact solver, which uses inertias only. Where h D / 2 is more than I the rate would change its sign at every step;
there the joint is given h D, and stops within a step.

MuJoCo scales how far a contact gives way by the inertia that the foot shows the floor. That must not depend on the
step, so the feet's impedance d is changed to keep the regularisation R = (1 - d) / d * A, and their reference
acceleration with it (MuJoCo documentation, Computation, "Solver parameters").
"""

from __future__ import annotations

import mujoco
import numpy as np

from chilopod.frozen import Array
from chilopod.robot import Twin

_IMPEDANCE = np.array([0.9, 0.95])
"""Impedance of a contact at first touch and deep: MuJoCo's defaults."""

_WIDTH, _MIDDLE, _POWER = 0.001, 0.5, 2.0  # of how impedance grows with depth: MuJoCo's defaults


def with_step(spec: mujoco.MjSpec, twin: Twin) -> None:
    """Adapt the joints and feet of a description to the step of the twin; servo joints have the inertia of their motors
    as ``armature``, feet are geoms named ``*_foot``."""
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    feet = [geom for geom in spec.geoms if geom.name.endswith("_foot")]
    own = _mobility(spec, feet)
    half = 0.5 * twin.timestep * twin.servo_damping
    driven = {servo.target for servo in spec.actuators if servo.biastype == mujoco.mjtBias.mjBIAS_AFFINE}
    for joint in spec.joints:
        if joint.name in driven:
            joint.armature = max(twin.joint_inertia + half, 2.0 * half)
    for foot, ratio in zip(feet, own / _mobility(spec, feet), strict=True):
        impedance = 1.0 / (1.0 + ratio * (1.0 - _IMPEDANCE) / _IMPEDANCE)
        touch, deep = impedance / _IMPEDANCE
        foot.solimp = [*impedance, _WIDTH, _MIDDLE, _POWER]
        foot.solref = [twin.contact_time / deep, touch**0.5]


def _mobility(spec: mujoco.MjSpec, feet: list[mujoco.MjsGeom]) -> Array:
    """Inverse of the effective mass of each foot at the floor, as MuJoCo defines it, 1/kg."""
    model = spec.compile()
    return np.array([model.body_invweight0[model.geom_bodyid[model.geom(foot.name).id], 0] for foot in feet])
