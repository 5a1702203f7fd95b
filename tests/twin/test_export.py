"""Exported files: plain MuJoCo makes the same model of the MJCF, and a robot of the same parts of the URDF."""

from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest

from chilopod import load_robot
from chilopod.errors import ParameterError
from chilopod.twin import TwinModel, initial_states, simulate
from chilopod.twin.export import format_of, mjcf, urdf
from chilopod.twin.legs import servo_targets

PRESET = load_robot("aoi2022")
# Numbers of many digits everywhere.
ODD = PRESET.set_from_text(
    [
        "body.mass=8.123456789012 kg", "body.length=1.23456789012 m", "springs.stiffness[0]=15.123456789 N*mm/deg",
        "springs.damping=0.0123456789012", "legs.forward_offset=0.0345678901234 m",
        "legs.half_width=0.0654321098765 m", "twin.upper_link=61.2345678901 mm", "twin.lower_link=57.6543210987 mm",
        "twin.link_mass=0.0371234567891 kg", "twin.foot_radius=6.12345678901 mm", "twin.hip_height=97.1234567891 mm",
        "twin.body_width=98.7654321098 mm", "twin.servo_stiffness=7.65432109876", "twin.servo_damping=0.123456789012",
        "twin.joint_inertia=0.000987654321098", "twin.sliding_friction=0.678901234567",
        "twin.contact_time=0.0212345678901 s", "twin.impedance_ratio=5.12345678901",
        "twin.scanner_offset=0.0812345678901 m", "twin.pole_radius=0.0312345678901 m",
        "twin.yaw_friction=0.0312345678901", "twin.leg_friction=0.0512345678901",
    ]
)  # fmt: skip
ODD = ODD.with_(twin=ODD.twin.model_copy(update={"control_interval": 0.00201234567891, "timestep": 0.00201234567891}))
FEWER = ODD.with_value("body.modules", 3).with_(name='nasty <name> & "quotes" -- µ')

# What the viewer is given in addition, and what counts or locates it.
DECORATION = ("cam_", "sensor", "light_", "mat_", "tex_", "key_", "names", "name_", "geom_matid", "paths")


@pytest.fixture(params=[PRESET, ODD, FEWER], ids=["preset", "odd numbers", "three modules"])
def robot(request):
    return request.param


def loaded(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return mujoco.MjModel.from_xml_path(str(path))


def test_mjcf_is_the_same_model_to_the_bit(robot, tmp_path):
    ours, theirs = TwinModel(robot).model, loaded(tmp_path, "robot.xml", mjcf(robot))
    compared = 0
    for owner, other in ((ours, theirs), (ours.opt, theirs.opt)):
        for name in dir(owner):
            value = getattr(owner, name)
            if name.startswith(("_", *DECORATION)) or not isinstance(value, np.ndarray):
                continue
            np.testing.assert_array_equal(value, getattr(other, name), err_msg=name)
            compared += 1
    assert compared > 200
    for name in ("timestep", "impratio", "integrator", "cone", "solver", "tolerance", "iterations", "disableflags"):
        assert getattr(ours.opt, name) == getattr(theirs.opt, name)
    names = [
        [m.joint(i).name for i in range(m.njnt)] + [m.geom(i).name for i in range(m.ngeom)] for m in (ours, theirs)
    ]
    assert names[0] == names[1]


def test_mjcf_walks_the_same_walk(robot, tmp_path):
    model = loaded(tmp_path, "robot.xml", mjcf(robot))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    np.testing.assert_array_equal(data.qpos, initial_states(robot)[0])
    compiled, interval = TwinModel(robot), robot.twin.control_interval
    targets = servo_targets(robot, np.arange(500) * interval)
    np.testing.assert_array_equal(data.ctrl[compiled.leg_controls], targets[0])
    for target in targets:
        data.ctrl[compiled.leg_controls] = target
        mujoco.mj_step(model, data)
    record = simulate(robot, 500 * interval, rate=1.0 / interval, poses=True)
    np.testing.assert_array_equal(record.pose.values[-1, 0], data.qpos)


def test_a_loop_over_the_keyframes_walks(tmp_path):
    model = loaded(tmp_path, "robot.xml", mjcf(PRESET))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    gait = [i for i in range(model.nkey) if model.key(i).name.startswith("gait")]
    period = gait_period = len(gait) * model.key_time[gait[1]]
    assert gait_period == pytest.approx(PRESET.gait.period)
    start = data.qpos[:2].copy()
    while data.time < 5.0:
        data.ctrl[:] = [
            np.interp(data.time, model.key_time[gait], row, period=period) for row in model.key_ctrl[gait].T
        ]
        mujoco.mj_step(model, data)
    ours = simulate(PRESET, 5.0, rate=1.0, poses=True).pose.values[-1, 0]
    assert np.linalg.norm(data.qpos[:2] - start) > 0.2
    assert data.qpos[:2] == pytest.approx(ours[:2], abs=0.02)
    assert data.sensor("yaw1").data == pytest.approx(data.joint("yaw1").qpos, abs=1e-4)  # of one step before
    assert data.sensor("position").data == pytest.approx(data.body("module1").xipos, abs=0.05)


def test_mjcf_is_fit_to_be_looked_at(tmp_path):
    model = loaded(tmp_path, "robot.xml", mjcf(PRESET))
    assert model.nlight == model.ncam == 1
    assert model.geom("floor").matid[0] == model.material("floor").id
    assert model.stat.extent == pytest.approx(PRESET.body.length)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(500):
        mujoco.mj_step(model, data)
    # With the targets of the keyframe it stands.
    assert np.abs(data.qvel).max() < 0.05
    assert data.qpos[2] == pytest.approx(PRESET.twin.hip_height + PRESET.twin.foot_radius, abs=5e-3)


def test_urdf_has_the_parts_of_the_robot(robot, tmp_path):
    text = urdf(robot)
    ours, theirs = TwinModel(robot).model, loaded(tmp_path, "robot.urdf", text)
    assert theirs.body_mass.sum() == pytest.approx(robot.body.mass, rel=1e-12)
    for index in range(ours.nbody):
        body = ours.body(index)
        if not (body.name.startswith(("module", "leg"))):
            continue
        # What URDF needs between two joints of one link, it takes from the link.
        carrier = f"{body.name.removesuffix('_upper')}_carrier"
        carried = [carrier] if body.name.endswith("_upper") and carrier in text else []
        other = [theirs.body(name) for name in (body.name, *carried)]
        assert sum(each.mass[0] for each in other) == pytest.approx(body.mass[0], rel=1e-12)
        np.testing.assert_allclose(sum(_sorted_inertia(each) for each in other), _sorted_inertia(body), rtol=1e-9)
    assert _joints(theirs) == _joints(ours) - {"root"}
    for name in _joints(theirs):
        np.testing.assert_array_equal(theirs.joint(name).axis, ours.joint(name).axis)
        assert theirs.joint(name).range[1] >= 0.5 * np.pi - 1e-12
        yaw = name.startswith("yaw")
        assert theirs.joint(name).damping[0] == (robot.springs.damping[0] if yaw else 0.0)
        assert theirs.joint(name).frictionloss[0] == (robot.twin.yaw_friction if yaw else robot.twin.leg_friction)
    # Feet collide and nothing else; what cannot be said in URDF is told.
    root = ET.fromstring(text)
    assert root.get("name") == robot.name
    assert len(root.findall("link/collision")) == 2 * robot.body.modules
    assert all(link.find("inertial/mass") is not None for link in root.findall("link"))
    children = [joint.find("child").get("link") for joint in root.findall("joint")]
    assert {link.get("name") for link in root.findall("link")} - set(children) == {"module1"}
    assert "stiffness" in text.split("<link")[0]
    assert repr(robot.springs.stiffness[0]) in text.split("<link")[0]


def test_urdf_puts_everything_where_the_model_has_it(robot, tmp_path):
    compiled = TwinModel(robot)
    ours, theirs = compiled.model, loaded(tmp_path, "robot.urdf", urdf(robot))
    first, second = mujoco.MjData(ours), mujoco.MjData(theirs)
    rng = np.random.default_rng(1)
    for _ in range(5):
        first.qpos[:3] = 0.0  # the root of the URDF stays at the origin
        for name in _joints(theirs):
            angle = rng.uniform(-1.5, 1.5)
            first.qpos[ours.joint(name).qposadr], second.qpos[theirs.joint(name).qposadr] = angle, angle
        mujoco.mj_fwdPosition(ours, first)
        mujoco.mj_fwdPosition(theirs, second)
        for index in compiled.feet.ravel():
            here, there = first.geom_xpos[index], second.geom_xpos[theirs.geom(ours.geom(index).name).id]
            np.testing.assert_allclose(there, here, rtol=0, atol=1e-9)
        for index in range(ours.nbody):
            name = ours.body(index).name
            if name.startswith(("module", "leg")):
                here, there = first.xipos[index], second.xipos[theirs.body(name).id]
                np.testing.assert_allclose(there, here, rtol=0, atol=1e-9)
        # Joint by joint the moments of inertia agree, but for the motors', which URDF cannot say.
        mass = [np.zeros((m.nv, m.nv)) for m in (ours, theirs)]
        mujoco.mj_fullM(ours, first, mass[0])
        mujoco.mj_fullM(theirs, second, mass[1])
        dofs = [[int(m.joint(name).dofadr[0]) for name in sorted(_joints(theirs))] for m in (ours, theirs)]
        here = (mass[0] - np.diag(ours.dof_armature))[np.ix_(dofs[0], dofs[0])]
        np.testing.assert_allclose(mass[1][np.ix_(dofs[1], dofs[1])], here, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("write", [mjcf, urdf])
def test_what_cannot_be_built_is_not_exported(write):
    for bad in (load_robot("aoi2022-planar"), PRESET.set_from_text(["twin.hip_height=13 cm"])):
        with pytest.raises(ParameterError):
            write(bad)


def test_formats_go_by_suffix():
    assert format_of(".xml") == ("MJCF", mjcf)
    assert format_of(".URDF") == ("URDF", urdf)
    for suffix in ("", ".sdf"):
        with pytest.raises(ParameterError, match="urdf"):
            format_of(suffix)


def _joints(model):
    return {model.joint(index).name for index in range(model.njnt)}


def _sorted_inertia(body):
    return np.sort(body.inertia)
