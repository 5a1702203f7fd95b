import mujoco
import numpy as np
import pytest

from chilopod import load_robot
from chilopod.robot import Twin
from chilopod.twin import initial_states, simulate
from chilopod.twin.model import TwinModel
from chilopod.twin.step import with_step

PRESET = load_robot("aoi2022")
INERTIA = 2e-3  # kg*m^2, of a hinge's body beside its motor


def hinge(twin: Twin) -> mujoco.MjModel:
    """One servo that drives one hinge, nothing else."""
    spec = mujoco.MjSpec()
    spec.option.timestep = twin.timestep
    body = spec.worldbody.add_body(name="arm")
    body.explicitinertial, body.mass, body.inertia = True, 1.0, [INERTIA] * 3
    body.add_joint(name="joint", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], armature=twin.joint_inertia)
    gains = [0.0, -twin.servo_stiffness, -twin.servo_damping]
    spec.add_actuator(
        name="servo",
        target="joint",
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        gainprm=[twin.servo_stiffness] + [0.0] * 9,
        biasprm=gains + [0.0] * 7,
    )
    with_step(spec, twin)
    return spec.compile()


def rates(model: mujoco.MjModel) -> np.ndarray:
    """Eigenvalues of one step as exponents, 1/s."""
    data, columns = mujoco.MjData(model), []
    for state in np.eye(2):
        mujoco.mj_resetData(model, data)
        data.qpos[0], data.qvel[0] = state
        mujoco.mj_step(model, data)
        columns.append([data.qpos[0], data.qvel[0]])
    return np.sort_complex(np.log(np.linalg.eigvals(np.array(columns).T).astype(complex)) / model.opt.timestep)


def twin_with(**changed: float) -> Twin:
    return Twin(**{**dict(PRESET.twin), **changed})


@pytest.mark.parametrize("damping", [0.05, 0.2, 0.6])
def test_a_servo_moves_as_it_should_to_second_order(damping):
    off = []
    for step in (2e-3, 1e-3, 5e-4):
        twin = twin_with(timestep=step, servo_damping=damping, joint_inertia=8e-4)
        mass = INERTIA + twin.joint_inertia
        exact = np.sort_complex(np.roots([mass, damping, twin.servo_stiffness]).astype(complex))
        off.append(np.abs(rates(hinge(twin)) / exact - 1.0).max())
    assert off[0] < 0.04
    np.testing.assert_allclose(np.log2(np.array(off[:-1]) / off[1:]), 2.0, atol=0.1)


@pytest.mark.parametrize("damping", [5.0, 100.0])
def test_a_servo_of_any_damping_comes_to_rest_without_a_change_of_sign(damping):
    twin = twin_with(servo_damping=damping, joint_inertia=1e-4)
    model = hinge(twin)
    data = mujoco.MjData(model)
    data.qvel[0] = 1.0
    for _ in range(100):
        mujoco.mj_step(model, data)
        data.qpos[0] = 0.0  # its stiffness is not asked
        assert 0.0 <= data.qvel[0] < 1.0


@pytest.mark.parametrize(("depth", "off", "stiff"), [(1e-7, 1e-3, 1e-3), (4e-4, 5e-3, 5e-3), (2e-3, 1e-3, 2e-2)])
def test_contacts_give_way_at_a_step_as_at_a_small_one(depth, off, stiff):
    """Regularisation and damping at both ends of how impedance grows with depth, stiffness at first touch."""
    seen = []
    for step in (2e-3, 1e-5):
        compiled = TwinModel(PRESET.with_value("twin.timestep", step))
        data = mujoco.MjData(compiled.model)
        data.qpos[:] = compiled.initial_positions()
        data.qpos[2] -= depth
        mujoco.mj_forward(compiled.model, data)
        # Columns of KBIP: stiffness, damping, impedance. The position's part of the reference is their product.
        stiffness, damping, impedance = data.efc_KBIP[:, :3].T
        seen.append((data.efc_R.copy(), damping.copy(), stiffness * impedance))
    assert seen[0][0].size
    for one, other, within in zip(*seen, (off, off, stiff), strict=True):
        np.testing.assert_allclose(one, other, rtol=within)


@pytest.mark.slow
def test_a_curved_walk_does_not_hang_on_the_step():
    robot = PRESET.set_from_text(["springs.stiffness[0]=15 N*mm/deg", "twin.servo_damping=0.5"])
    bends = []
    for step in (2e-3, 5e-4):
        finer = robot.with_value("twin.timestep", step)
        start = initial_states(finer, [0.5, 0.3, 0.4, 0.4, 0.15])
        walk = simulate(finer, 24.0, initial=start, rate=10.0)
        bends.append(float(np.abs(walk.joint_angle.isel(robot=0)[-48:].mean("time")).sum()))
    assert bends[0] == pytest.approx(bends[1], rel=0.05)
