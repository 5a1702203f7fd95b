"""The compiled model: everything that was described is in it, once."""

import mujoco
import numpy as np
import pytest

from chilopod import load_robot
from chilopod.analysis.map_axes import with_modules
from chilopod.errors import ParameterError
from chilopod.planar import PlanarModel
from chilopod.twin import TwinModel
from chilopod.twin.legs import joint_angles
from helpers.leg_tips import tip_place

PRESET = load_robot("aoi2022")

OVERRIDES = [
    [],
    [
        "springs.stiffness[0]=12.3 N*mm/deg", "springs.stiffness[3]=77 N*mm/deg", "springs.damping=0.0123",
        "twin.servo_stiffness=3.21", "twin.servo_damping=0.0456", "twin.joint_inertia=0.00078",
        "twin.sliding_friction=0.91", "twin.contact_time=0.0123 s", "twin.impedance_ratio=7.7",
        "twin.yaw_friction=0.03", "twin.leg_friction=0.05",
        "twin.timestep=0.5 ms",
    ],
    ["body.modules=9", "springs.damping=0", "twin.joint_inertia=0"],
]  # fmt: skip


@pytest.mark.parametrize("modules", [2, 3, 6, 20])
def test_mass_and_length_add_up(modules):
    robot = PRESET.set_from_text([f"body.modules={modules}", "body.mass=8.123456789 kg", "body.length=1.2345 m"])
    twin = TwinModel(robot)
    model, data = twin.model, mujoco.MjData(twin.model)
    mujoco.mj_forward(model, data)
    assert model.body_mass.sum() == pytest.approx(robot.body.mass, rel=1e-14)
    first, last = model.body("module1").id, model.body(f"module{modules}").id
    between = data.xpos[first, 0] - data.xpos[last, 0]
    assert between + robot.module_length == pytest.approx(robot.body.length, rel=1e-14)
    assert model.jnt_pos[twin.yaw_joints].tolist() == [[0.5 * robot.module_length, 0.0, 0.0]] * (modules - 1)
    # Whatever a module is made of, all are alike.
    of_module = [model.body_subtreemass[model.body(f"module{i + 1}").id] for i in range(modules)]
    np.testing.assert_allclose(-np.diff([*of_module, 0.0]), robot.module_mass, rtol=1e-12)
    assert model.nq == 7 + (modules - 1) + 4 * modules + 2
    assert model.nu == 4 * modules + 2


def composite_yaw_inertia(twin, module):
    """Of a module's body and the links that hang from it about its centre, legs at mid-stroke, from MuJoCo's arrays."""
    model, data = twin.model, mujoco.MjData(twin.model)
    data.qpos[:] = twin.initial_positions()
    data.qpos[twin.leg_positions] = joint_angles(twin.twin, 0.0, twin.twin.hip_height)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    names = [f"leg{module}_{side}_{link}" for side in ("left", "right") for link in ("upper", "lower")]
    total = 0.0
    for each in [model.body(f"module{module}").id, *(model.body(name).id for name in names)]:
        axes = data.ximat[each].reshape(3, 3)
        place = (data.xipos[each] - data.xpos[model.body(f"module{module}").id])[:2]
        total += axes[2] ** 2 @ model.body_inertia[each] + model.body_mass[each] * place @ place
    return total


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["body.yaw_inertia=0.008"],
        ["body.yaw_inertia=0.012", "twin.upper_link=50 mm", "twin.lower_link=75 mm", "legs.forward_offset=-20 mm"],
        ["body.modules=12"],
        ["twin.hip_height=118 mm"],
    ],
)
def test_a_module_with_its_legs_has_the_yaw_inertia_of_the_robot(overrides):
    robot = PRESET.set_from_text(overrides)
    twin = TwinModel(robot)
    for module in (1, 2, robot.body.modules):
        assert composite_yaw_inertia(twin, module) == pytest.approx(robot.module_yaw_inertia, rel=1e-12)
    assert PlanarModel(robot).scalars[0, 2] == robot.module_yaw_inertia
    if "body.yaw_inertia=0.008" in overrides:
        assert robot.module_yaw_inertia == 0.008


@pytest.mark.parametrize("modules", [2, 3, 8, 9, 20, 30, 52])
@pytest.mark.parametrize("alike", [False, True])
def test_without_a_yaw_inertia_any_number_of_modules_can_be_built(modules, alike):
    robot = with_modules(PRESET, modules) if alike else PRESET.with_value("body.modules", modules)
    twin = TwinModel(robot)
    rod = robot.module_mass * robot.module_length**2 / 12.0
    if alike or modules <= 8:
        assert robot.module_yaw_inertia == rod
    else:
        # So short that the legs and the width of the body alone have more.
        assert robot.module_yaw_inertia > rod
    roll, pitch, yaw = twin.model.body("module2").inertia
    mass = robot.module_mass - 4.0 * robot.twin.link_mass
    assert roll == pytest.approx(mass * (robot.twin.body_width**2 + robot.twin.body_height**2) / 12.0)
    # Such a body exists: no more of its mass is anywhere than there is.
    across, along = mass * robot.twin.body_width**2 / 12.0, pitch - mass * robot.twin.body_height**2 / 12.0
    assert yaw == pytest.approx(across + along)
    assert -1e-15 <= along <= 0.25 * mass * robot.module_length**2


@pytest.mark.parametrize("overrides", OVERRIDES)
def test_every_constant_has_one_owner(overrides):
    robot = PRESET.set_from_text(overrides)
    compiled, twin = TwinModel(robot), robot.twin
    model = compiled.model
    # Springs and their damping: the yaw joints and nothing else.
    stiffness, damping = np.zeros(model.njnt), np.zeros(model.nv)
    stiffness[compiled.yaw_joints] = robot.springs.stiffness
    damping[compiled.yaw_rates] = robot.springs.damping
    np.testing.assert_array_equal(model.jnt_stiffness, stiffness)
    np.testing.assert_array_equal(model.dof_damping, damping)
    for nothing in (model.jnt_limited, model.body_gravcomp, model.qpos_spring[7:]):
        assert not nothing.any()
    assert model.ntendon == model.neq == model.npair == 0
    # Motors: the actuators have the gains, the leg joints the inertia.
    legs = np.concatenate([compiled.leg_positions.ravel(), compiled.leg_yaw_positions]) - 1
    friction = np.zeros(model.nv)
    friction[compiled.yaw_rates], friction[legs] = twin.yaw_friction, twin.leg_friction
    np.testing.assert_array_equal(model.dof_frictionloss, friction)
    inertia = np.zeros(model.nv)
    half = 0.5 * twin.timestep * twin.servo_damping  # what the step adds to a damped joint
    inertia[legs] = max(twin.joint_inertia + half, 2.0 * half)
    np.testing.assert_array_equal(model.dof_armature, inertia)
    assert (model.actuator_gainprm[:, 0] == twin.servo_stiffness).all()
    expected = [0.0, -twin.servo_stiffness, -twin.servo_damping]
    np.testing.assert_array_equal(model.actuator_biasprm[:, :3], np.tile(expected, (model.nu, 1)))
    assert not model.actuator_gainprm[:, 1:].any()
    assert not model.actuator_biasprm[:, 3:].any()
    assert sorted(model.actuator_trnid[:, 0]) == sorted(set(range(model.njnt)) - {0, *compiled.yaw_joints})
    # Options.
    assert model.opt.timestep == twin.timestep
    assert model.opt.impratio == twin.impedance_ratio
    assert compiled.steps_per_control == round(twin.control_interval / twin.timestep)


@pytest.mark.parametrize("overrides", OVERRIDES)
def test_contacts_are_those_of_feet_and_theirs_is_the_friction(overrides):
    robot = PRESET.set_from_text(overrides)
    compiled = TwinModel(robot)
    model, data = compiled.model, mujoco.MjData(compiled.model)
    data.qpos[:] = compiled.initial_positions()
    data.qpos[2] -= robot.twin.clearance + 1e-3  # all feet on the floor, swinging ones too
    mujoco.mj_forward(model, data)
    contact = data.contact
    assert sorted(contact.geom2) == sorted(compiled.feet.ravel())
    assert (contact.geom1 == model.geom("floor").id).all()
    assert (contact.dim == 3).all()
    np.testing.assert_array_equal(contact.friction[:, :2], robot.twin.sliding_friction)
    # But for what the step changes: time constant and impedance go together.
    np.testing.assert_allclose(contact.solref[:, 0] * contact.solimp[:, 1], 0.95 * robot.twin.contact_time, rtol=1e-12)
    # Rolled over, it falls through the floor: bodies and links touch nothing.
    data.qpos[2:7] = [0.0, 0.0, 1.0, 0.0, 0.0]
    mujoco.mj_forward(model, data)
    assert data.ncon == 0


def test_feet_are_where_the_leg_kinematics_say():
    compiled = TwinModel(PRESET)
    model, data = compiled.model, mujoco.MjData(compiled.model)
    data.qpos[:] = compiled.initial_positions()
    angles = np.random.default_rng(0).uniform(-1.0, 1.0, (6, 2, 2))
    data.qpos[compiled.leg_positions] = angles
    mujoco.mj_kinematics(model, data)
    tip = tip_place(PRESET.twin, angles)
    module = -PRESET.module_length * np.arange(6)[:, None]
    expected = [
        module + PRESET.legs.forward_offset + tip[..., 0],
        np.tile([PRESET.legs.half_width, -PRESET.legs.half_width], (6, 1)),
        data.qpos[2] - tip[..., 1],
    ]
    np.testing.assert_allclose(data.geom_xpos[compiled.feet], np.stack(expected, -1), rtol=0, atol=1e-14)


def test_standing_feet_touch_the_floor_and_swinging_ones_do_not():
    compiled = TwinModel(PRESET)
    data = mujoco.MjData(compiled.model)
    data.qpos[:] = compiled.initial_positions()
    mujoco.mj_kinematics(compiled.model, data)
    below = data.geom_xpos[compiled.feet][..., 2] - PRESET.twin.foot_radius
    phases = PRESET.gait.leg_phases(6)
    standing = phases < PRESET.gait.duty
    np.testing.assert_allclose(below[standing], -1e-6, rtol=0, atol=1e-12)  # firmly, whatever round-off says
    assert (below[~standing] > 1e-4).all()


@pytest.mark.parametrize(
    ("override", "field"),
    [
        ("twin.hip_height=130 mm", "twin.hip_height"),
        ("twin.upper_link=1 mm", "twin.hip_height"),
        ("twin.link_mass=0.36 kg", "twin.link_mass"),
        ("body.modules=60", "twin.link_mass"),
        ("body.mass=0.9 kg", "twin.link_mass"),
        ("twin.body_height=208.1 mm", "twin.body_height"),
        ("body.yaw_inertia=1e-4", "body.yaw_inertia"),
        ("body.yaw_inertia=1", "body.yaw_inertia"),
    ],
)
def test_robots_that_cannot_be_are_refused(override, field):
    with pytest.raises(ParameterError) as caught:
        TwinModel(PRESET.set_from_text([override]))
    assert caught.value.field == field
    assert caught.value.allowed
    assert "\n" not in str(caught.value)


def test_what_mujoco_itself_refuses_is_one_line_of_its_words():
    with pytest.raises(ParameterError, match="larger than mjMINVAL") as caught:
        TwinModel(PRESET.set_from_text(["twin.foot_radius=1e-8 m"]))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "override",
    [
        "twin.servo_stiffness=0",
        "twin.servo_stiffness=1e5",
        "twin.servo_damping=-1",
        "twin.sliding_friction=0",
        "twin.timestep=0.03 s",
        "twin.timestep=1.5 ms",  # does not go into 2 ms
        "twin.timestep=4 ms",
        "twin.control_interval=3.3 ms",
        "twin.foot_radius=0",
        "twin.joint_inertia=-1e-3",
        "springs.stiffness=0",
    ],
)
def test_numbers_out_of_range_are_refused_when_set(override):
    with pytest.raises(ParameterError) as caught:
        PRESET.set_from_text([override])
    assert override.partition("=")[0].endswith(caught.value.field)


def test_a_robot_of_which_mujoco_warns_is_refused():
    with pytest.raises(ParameterError, match=r"MuJoCo cannot build this robot .*singular"):
        TwinModel(PRESET.set_from_text(["body.length=1e9 m"]))
