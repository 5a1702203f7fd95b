"""Robots: reading, refusing, overriding, writing."""

import copy
import math
import pickle
import tomllib
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chilopod import ChilopodError, Gait, ParameterError, Robot, RobotFileError, UnitError, load_robot
from chilopod.robot import Body, Legs, Springs, presets, remarks

PRESET = "aoi2022-planar"


@pytest.fixture(scope="module")
def robot():
    return load_robot(PRESET)


def table():
    return tomllib.loads(load_robot(PRESET).to_toml())


def changed(path, value):
    """The preset as a table with one entry set, or deleted where value is `...`."""
    result = table()
    *sections, key = path.split("/")
    place = result
    for section in sections:
        place = place[section]
    if value is ...:
        del place[key]
    else:
        place[key] = value
    return result


# -- the preset


def test_preset_has_the_numbers_of_the_paper(robot):
    assert robot.body == Body(modules=6, length=1.35, mass=8.5)
    assert robot.springs == Springs(stiffness=["41 N*mm/deg"] * 5, damping=0.0)
    # What `chilopod identify planar` finds, rounded: tests/tasks/identify/test_planar.py.
    assert robot.legs == Legs(forward_offset="49.3 mm", half_width="73.2 mm")
    assert robot.ground.friction == 246.5
    assert robot.module_length == pytest.approx(0.225)
    assert robot.module_mass == pytest.approx(8.5 / 6)
    assert robot.module_yaw_inertia == pytest.approx(8.5 / 6 * 0.225**2 / 12)


@pytest.mark.parametrize("name", presets())
def test_every_number_of_a_preset_says_where_it_comes_from(name):
    preset = load_robot(name)
    assert preset.name == name
    assert all(preset.provenance_of(path) for path in preset.parameters())
    assert remarks(preset) == []


# -- reading and writing


@st.composite
def robots(draw):
    joints = draw(st.integers(2, 9)) - 1
    positive = st.floats(1e-6, 1e6)
    angle = st.floats(-2 * math.pi, 2 * math.pi)
    return Robot(
        name=draw(st.text("abc -_'\"\\äµ", min_size=1).filter(str.strip)),
        body=Body(
            modules=joints + 1, length=draw(positive), mass=draw(positive), yaw_inertia=draw(st.none() | positive)
        ),
        springs=Springs(
            stiffness=draw(st.lists(positive, min_size=joints, max_size=joints)),
            damping=draw(st.lists(st.floats(0, 1e6), min_size=joints, max_size=joints)),
        ),
        legs=Legs(forward_offset=draw(st.floats(-10, 10)), half_width=draw(st.floats(0, 10))),
        gait=Gait(
            stride=draw(positive),
            stance=draw(positive),
            swing=draw(positive),
            module_phase=draw(angle),
            side_phase=draw(angle),
        ),
        ground={"friction": draw(positive)},
    )


@given(robots())
def test_round_trip_through_toml_is_exact(described):
    assert Robot(**tomllib.loads(described.to_toml())) == described


def test_the_twin_and_provenance_survive():
    first = load_robot("aoi2022")
    again = Robot(**tomllib.loads(first.to_toml()))
    assert again == first
    assert hash(again) == hash(first)
    assert pickle.loads(pickle.dumps(first)) == first
    assert again.twin.hip_height == 0.098
    assert first.provenance_of("twin.clearance")


def test_a_twin_is_overridden_and_checked_like_all_else(robot):
    whole = load_robot("aoi2022")
    assert whole.override("twin.clearance", "8 mm").twin.clearance == 0.008
    assert "twin.clearance" in whole.parameters()
    assert "twin.clearance" not in robot.parameters()
    with pytest.raises(ParameterError, match=r"twin.clearance: needs a table \[twin\]"):
        robot.get("twin.clearance")
    with pytest.raises(ParameterError, match="must divide"):
        whole.with_value("twin.timestep", 0.0015)
    with pytest.raises(ParameterError, match=r"did you mean 'twin\.clearance'"):
        whole.get("twin.clearence")


def test_provenance_keys_need_no_quotes():
    described = Robot(**changed("provenance", {"gait": {"stride": "measured"}}))
    assert described.provenance_of("gait.stride") == "measured"


def test_one_spring_stands_for_all(robot):
    assert Robot(**changed("springs/stiffness", "41 N*mm/deg")).springs == robot.springs
    assert Robot(**changed("springs/damping", ["0"] * 5)).springs == robot.springs


def test_objects_are_frozen(robot):
    with pytest.raises(ValueError, match="frozen"):
        robot.body.mass = 1.0
    with pytest.raises(TypeError):
        robot.provenance["gait.stride"] = "x"


# -- overrides


def test_override_and_get(robot):
    softer = robot.override("springs.stiffness[0]", "12 N*mm/deg")
    assert softer.get("springs.stiffness[0]") == pytest.approx(12e-3 * 180 / math.pi, rel=1e-15)
    assert softer.springs.stiffness[1:] == robot.springs.stiffness[1:]
    assert softer.gait is robot.gait
    assert softer.provenance_of("springs.stiffness[0]") == "set by override"
    assert softer.provenance_of("springs.stiffness[1]") == robot.provenance_of("springs.stiffness[1]")
    assert robot.unit_of("springs.stiffness") == "N*mm/deg"
    assert robot.si_unit_of("springs.stiffness") == "N*m/rad"
    with pytest.raises(ParameterError, match=r"must be one spring, such as springs\.stiffness\[0\], because"):
        softer.get("springs.stiffness")


def test_override_of_all_springs(robot):
    group = robot.with_value("springs.stiffness[1:3]", 0.7)
    assert group.springs.stiffness == tuple(
        0.7 if joint in (1, 2) else value for joint, value in enumerate(robot.springs.stiffness)
    )
    assert group.get("springs.stiffness[1:3]") == group.with_value("springs.stiffness[:]", 0.7).get("springs.stiffness")
    assert [group.provenance_of(f"springs.stiffness[{i}]") == "set by override" for i in (0, 1, 2, 3)] == [
        False, True, True, False
    ]  # fmt: skip
    with pytest.raises(ParameterError, match=r"must be one spring, such as springs\.stiffness\[2\], because"):
        group.get("springs.stiffness[2:]")
    uniform = robot.with_value("springs.stiffness[0]", 0.7).with_value("springs.stiffness", 0.5)
    assert uniform.springs.stiffness == (0.5,) * 5
    assert uniform.get("springs.stiffness") == 0.5
    assert {uniform.provenance_of(f"springs.stiffness[{i}]") for i in range(5)} == {"set by override"}
    assert robot.with_value("springs.stiffness[01]", 1.0).provenance_of("springs.stiffness[1]") == "set by override"


def test_the_longest_provenance_can_be_copied(robot):
    told = "from the scales " * 62
    copy = robot.with_(provenance={"body.mass": told}).copied()
    assert copy.provenance_of("body.mass") == f"copied from {PRESET}: {told}"[:1000]


def test_setting_the_same_value_changes_nothing(robot):
    assert robot.with_value("gait.stride", 0.03) is robot


def test_number_of_modules_takes_the_springs_along(robot):
    robot = robot.with_value("springs.stiffness[4]", 0.3)
    assert robot.override("body.modules", 8).springs.stiffness[3:] == (robot.springs.stiffness[3], 0.3, 0.3, 0.3)
    short = robot.override("body.modules", "2")
    assert short.springs.stiffness == robot.springs.stiffness[:1]
    assert short.body.length == robot.body.length
    assert not any("[4]" in path for path in short.provenance)
    assert Robot(**tomllib.loads(short.to_toml())) == short


def test_yaw_inertia_is_the_rods_until_given(robot):
    assert robot.get("body.yaw_inertia") == robot.module_yaw_inertia
    assert robot.with_value("body.yaw_inertia", 0.01).module_yaw_inertia == 0.01


def test_set_from_text(robot):
    result = robot.set_from_text(["gait.stride = 1.8 cm", "springs.stiffness=28 N*mm/deg", "gait.module_phase=180 deg"])
    assert result.gait.stride == pytest.approx(0.018)
    assert result.gait.module_phase == math.pi
    assert robot.set_from_text([]) is robot


def test_with_replaces_and_validates(robot):
    assert robot.with_(name="other").name == "other"
    with pytest.raises(
        ParameterError, match=r"springs\.stiffness: must have one value for each joint, not 5; allowed: 3"
    ):
        robot.with_(body=Body(modules=4, length=1, mass=1))


@given(data=st.data())
def test_overrides_agree_with_a_file_that_says_the_same(data):
    robot = load_robot(PRESET)
    path = data.draw(st.sampled_from([p for p in robot.parameters() if p != "body.modules"]))
    value = data.draw(st.floats(1e-3, 5.0))
    result = robot.with_value(path, value)
    assert result.get(path) == value
    assert Robot(**tomllib.loads(result.to_toml())) == result
    # The inertia of a rod follows its mass and length.
    others = [other for other in robot.parameters() if other not in (path, "body.yaw_inertia")]
    assert [result.get(other) for other in others] == [robot.get(other) for other in others]


@pytest.mark.parametrize(
    ("assignment", "error", "complaint"),
    [
        ("springs.stifness[0]=1", ParameterError, "did you mean 'springs.stiffness[0]'?"),
        ("stiffness[2]=1", ParameterError, "did you mean 'springs.stiffness[2]'?"),
        ("legs.mass=1", ParameterError, "did you mean 'body.mass'?"),
        ("springs.stiffness[5]=1", ParameterError, "must be the index of a spring; allowed: 0 to 4"),
        ("springs.stiffness[5:]=1", ParameterError, "must be a group of springs; allowed: FIRST:END of indices from 0"),
        ("springs.stiffness[2:6]=1", ParameterError, "must be a group of springs"),
        ("springs.stiffness[-1]=1", ParameterError, "must be the path of a parameter"),
        ("body.mass[0]=1", ParameterError, "must be written without an index"),
        ("name=x", ParameterError, "not of a text"),
        ("provenance.gait.stride=1", ParameterError, "not of a text"),
        ("twin.x=1", ParameterError, "must be the path of a parameter"),
        ("body=1", ParameterError, "must be the path of a parameter"),
        ("=1", ParameterError, "must be the path of a parameter"),
        ("gait.stride", ParameterError, "allowed: PATH=VALUE"),
        ("gait.stride=3 kg", UnitError, "gait.stride = '3 kg': is a mass; allowed: a length"),
        ("gait.stride=", UnitError, "must start with a finite number"),
        ("gait.stride=nan", UnitError, "gait.stride"),
        ("body.modules=1", ParameterError, "allowed: 2 to 1000"),
        ("body.modules=2.5", ParameterError, "whole number"),
        ("body.modules=1e6", ParameterError, "allowed: 2 to 1000"),
        ("springs.damping=-1", ParameterError, "must not be negative"),
        ("springs.stiffness[0]=0", ParameterError, "must be positive"),
    ],
)
def test_overrides_refused(robot, assignment, error, complaint):
    with pytest.raises(error) as caught:
        robot.set_from_text([assignment])
    assert complaint in str(caught.value)


def test_numeric_path_refuses_too(robot):
    for value in (math.nan, math.inf, -1.0, 0.0, 1e300):
        with pytest.raises(ParameterError, match=r"springs\.stiffness\[0\]"):
            robot.with_value("springs.stiffness[0]", value)


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (
            "springs.stiffness[0]",
            -5e-3 * 180.0 / math.pi,
            "'-5 N*mm/deg': must be positive; allowed: more than 0 N*mm/",
        ),
        ("gait.module_phase", 2.5 * math.pi, "'450 deg': out of range; allowed: -360 deg to 360 deg"),
        ("body.mass", -1, "'-1 kg': must be positive; allowed: more than 0 kg"),
        ("ground.friction", -2.5, "'-2.5 N*s/m': must be positive; allowed: more than 0 N*s/m"),
        ("springs.stiffness[0]", math.inf, "inf: must be finite"),
        ("body.modules", 1, "1.0: out of range; allowed: 2 to 1000"),
    ],
)
def test_values_and_their_range_have_one_unit(robot, path, value, said):
    with pytest.raises(ParameterError) as caught:
        robot.with_value(path, value)
    assert str(caught.value).startswith(f"{path} = {said}")


@pytest.mark.parametrize("given", [1e10, "1e10"])
def test_a_number_without_a_unit_is_said_to_be_si(robot, given):
    limits = r"allowed: 1\.74533e-11 N\*mm/deg to 1\.74533e\+10 N\*mm/deg"  # more than the number that is refused
    with pytest.raises(ParameterError, match=f"{limits}; a number without a unit is in N\\*m/rad$"):
        robot.override("springs.stiffness[0]", given)
    with pytest.raises(ParameterError, match=f"'1e11 N\\*mm/deg': out of range; {limits}$"):
        robot.override("springs.stiffness[0]", "1e11 N*mm/deg")


def test_limits_of_a_spring_are_said_in_the_unit_of_robot_files(robot):
    with pytest.raises(
        ParameterError, match=r"= '20 N\*mm/deg': softest .* at joint 1; allowed: at most 10 N\*mm/deg$"
    ):
        robot.set_from_text(["springs.stiffest=10 N*mm/deg", "springs.softest=20 N*mm/deg"])


def test_numbers_of_any_type_become_floats_that_nobody_can_change(robot):
    mass = np.array(3.0)
    heavier = robot.with_value("body.mass", mass)
    mass[...] = -7.0
    assert heavier.body.mass == 3.0
    assert hash(heavier) == hash(robot.with_value("body.mass", Decimal(3)))
    assert type(robot.with_value("body.modules", np.array(5)).body.modules) is int
    for value in (np.array([3.0]), [3.0, 4.0], "7", None, 3 + 0j):
        with pytest.raises(ParameterError, match=r"body\.mass.*must be a number"):
            robot.with_value("body.mass", value)
    with pytest.raises(ParameterError, match=r"joint_angles.*one for each joint"):
        robot.axis_radius([0.1] * 4)


# -- bad files


def test_messages_show_numbers_of_numpy_as_numbers(robot):
    for value in (np.float64(-1.0), np.array(-1.0)):
        assert "= -1.0: " in str(ParameterError("must be positive", field="x", value=value))
    with pytest.raises(ParameterError) as refused:
        robot.with_value("springs.stiffness[0]", np.float64(-1.0))
    assert "np." not in str(refused.value)


@pytest.mark.parametrize(
    ("path", "value", "complaint"),
    [
        ("body/lenght", "1 m", "body.lenght: unknown key; did you mean 'length'?"),
        ("boddy", {}, "boddy: unknown key; did you mean 'body'?"),
        ("body", ..., "body: is missing"),
        ("body", 3, "body = 3: must be a table"),
        ("gait/swing", ..., "gait.swing: is missing"),
        ("body/length", "3 kg", "body.length = '3 kg': is a mass; allowed: a length"),
        ("body/mass", "-1 kg", "body.mass = '-1 kg': must be positive"),
        ("body/mass", 0, "body.mass = 0: must be positive"),
        ("body/mass", math.nan, "body.mass = nan: must be a finite number"),
        ("body/mass", math.inf, "body.mass = inf: must be a finite number"),
        ("body/mass", True, "body.mass = True: must be a quantity"),
        ("body/modules", 1, "body.modules = 1: out of range; allowed: 2 to 1000"),
        ("body/modules", 10**9, "body.modules = 1000000000: out of range"),
        ("body/modules", "six", "body.modules = 'six'"),
        (
            "body/modules",
            7,
            "springs.stiffness: must have one value for each joint, not 5; allowed: 6, one fewer than body.modules",
        ),
        ("springs/stiffness", ["1"] * 4, "springs.stiffness: must have one value for each joint, not 4; allowed: 5"),
        ("springs/stiffness", [1, 2, "x", 4, 5], "springs.stiffness[2] = 'x'"),
        ("springs/stiffness", {"a": 1}, "springs.stiffness = {'a': 1}: must be a list"),
        ("springs/damping", ["1"] * 6, "springs.damping: must have one value for each joint, not 6; allowed: 5"),
        ("springs/stiffness", "3 N*m", "springs.stiffness[0] = '3 N*m': is a torque"),
        ("gait/stance", "0 s", "gait.stance = '0 s': must be positive"),
        ("name", "", "name = ''"),
        ("name", "a\nb", "name = 'a\\nb'"),
        ("name", 5, "name = 5: must be text"),
        ("twin", 5, "twin = 5: must be a table"),
        (
            "provenance",
            {"gait.strid": "x"},
            "provenance.gait.strid: must be the path of a parameter; did you mean 'gait.stride'?",
        ),
        ("provenance", {"springs.damping[7]": "x"}, "provenance.springs.damping[7]: must be the index of a spring"),
        ("provenance", {"gait.stride": 5}, "provenance.gait.stride = 5: must be text"),
        ("provenance", {"gait.stride": "\x1b[31m"}, "provenance.gait.stride = '\\x1b[31m'"),
    ],
)
def test_bad_descriptions(path, value, complaint):
    with pytest.raises(ChilopodError) as caught:
        Robot(**changed(path, value))
    assert str(caught.value).startswith(complaint)
    assert str(caught.value).isprintable()


def test_an_integer_too_long_to_print_is_refused_like_any_other():
    with pytest.raises(UnitError, match="mass = <int>: must be a finite number"):
        Robot(**changed("body/mass", 16**5000))


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "is empty"),
        (b" \n", "is empty"),
        (b"\x00\x01\xff\xfe", "not a text file"),
        (b"name = ", "is not valid TOML"),
        (b"a = " + b"[" * 5000, "nested too deeply"),
        (b"a" + b".a" * 100 + b" = 1", "unknown key"),
        (b"a" + b".a" * 400_000 + b" = 1", "400000 dots in a key"),
        (b"provenance.''" + b".''" * 5000 + b" = 1", "5001 dots in a key"),
        (b"x = " + b"9" * 5000, "is not valid TOML"),
        (b"# " + b"x" * 1_000_001, "too large"),
        (b"name = 'x'", "body: is missing"),
    ],
)
def test_bad_files(tmp_path, content, complaint):
    file = tmp_path / "robot.toml"
    file.write_bytes(content)
    with pytest.raises(RobotFileError) as caught:
        load_robot(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert complaint in str(caught.value)


def test_a_byte_order_mark_is_skipped(tmp_path):
    (tmp_path / "robot.toml").write_text(load_robot(PRESET).to_toml(), encoding="utf-8-sig")
    assert load_robot(tmp_path / "robot.toml") == load_robot(PRESET)


@given(st.binary(max_size=200))
def test_random_files_are_refused(tmp_path_factory, content):
    file = tmp_path_factory.getbasetemp() / "random.toml"
    file.write_bytes(content)
    with pytest.raises(RobotFileError) as caught:
        load_robot(file)
    assert str(caught.value).isprintable()


toml_values = st.recursive(
    st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=6) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)


@given(
    st.sampled_from(["body", "springs", "gait", "name", "twin", "provenance", "body/mass", "springs/stiffness", "new"]),
    toml_values,
)
def test_random_entries_are_valid_or_refused(path, value):
    try:
        described = Robot(**changed(path, value))
    except ChilopodError as error:
        message = str(error)
    else:
        message = ""
        assert Robot(**tomllib.loads(described.to_toml())) == described
    assert message.isprintable()


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("aoi2022-planer", "must be a preset or an existing file; did you mean 'aoi2022-planar'?"),
        ("missing.toml", "missing.toml: no such file"),
        ("no/such/folder", "no/such/folder: no such file"),
        ("/", "is a folder"),
        ("/dev/zero", "not a regular file"),
        ("\0", "must be a preset or an existing file"),
        ("", "must be a preset or an existing file"),
        ("x" * 5000, "cannot be read"),
    ],
)
def test_missing_robots(name, complaint):
    with pytest.raises(RobotFileError) as caught:
        load_robot(name)
    assert complaint in str(caught.value)


# -- remarks


def test_remarks(robot):
    assert "whole period" in remarks(robot.override("gait.side_phase", "90 deg"))[0]
    assert "no foot of the robot" in remarks(robot.set_from_text(["gait.swing=9 s", "gait.module_phase=0"]))[0]
    assert "a module has no foot" in remarks(robot.override("gait.swing", "0.4 s"))[0]
    assert "reach" in remarks(robot.override("legs.forward_offset", "-1 m"))[0]
    edited = Robot.from_toml(robot.to_toml().replace("8.5 kg", "9 kg", 1))
    assert remarks(edited) == ["Numbers that are not those of the preset, with its provenance: body.mass."]
    for text, shown in (
        ("gait.stance=310", "gait.stance = 310 s is unusually large for gait.swing = 0.29 s."),
        ("springs.damping=1000", "springs.damping[0] = 1000 N*m*s/rad is unusually large for springs.stiffness[0]"),
        ("body.yaw_inertia=6", "body.yaw_inertia = 6 kg*m^2 is unusually large for body.mass"),
        ("springs.stiffness=41", "springs.stiffness[0] = 715.585 N*mm/deg is unusually large for ground.friction = "),
    ):
        first, *_, note = remarks(robot.set_from_text([text]))
        assert (first[: len(shown)], note) == (shown, "Are the units right? A number without a unit is SI.")
    assert "gait.stride" in remarks(robot.with_(provenance={}))[0]


def test_descriptions_accept_arrays_and_copy(robot):
    assert Springs(stiffness=np.full(5, 2.0), damping=np.float32(0)).stiffness == (2.0,) * 5
    assert copy.deepcopy(robot) == robot


ACTUATED = [
    "springs.adjustable[0]=true", "springs.softest=5 N*mm/deg", "springs.stiffest=80 N*mm/deg",
    "springs.rate=100 N*mm/deg/s", "springs.lag=0.1 s",
]  # fmt: skip


def test_what_is_adjustable_is_part_of_the_file_and_absent_means_fixed():
    fixed = load_robot("aoi2022-planar")
    assert fixed.springs.adjustable is None
    assert "adjustable" not in fixed.to_toml()
    assert not any("adjustable" in path or "softest" in path for path in fixed.parameters())
    robot = fixed.set_from_text(ACTUATED)
    assert robot.springs.adjustable == (True, False, False, False, False)
    assert Robot.from_toml(robot.to_toml()) == robot
    assert robot.get("springs.rate") == pytest.approx(0.1 * 180.0 / np.pi)
    assert robot.with_value("body.modules", 8).springs.adjustable == (True,) + (False,) * 6
    assert robot.override("springs.adjustable", "true").springs.adjustable == (True,) * 5
    assert fixed.override("springs.adjustable[0]", "false").springs.adjustable == (False,) * 5
    table = {"adjustable": True, "lag": "50 ms", "stiffness": "41 N*mm/deg", "damping": 0.0}
    assert Robot(**{**dict(fixed), "springs": table}).springs.lag == (0.05,) * 5


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        (["springs.adjustable=perhaps"], "springs.adjustable"),
        (["springs.adjustable=1"], "springs.adjustable"),
        (["springs.softest[0]=3 N*mm/deg"], "springs.softest[0]"),
        (["springs.softest=90 N*mm/deg", "springs.stiffest=80 N*mm/deg"], "springs.stiffest"),
        (["springs.rate=0 N*mm/deg/s"], "springs.rate"),
        (["springs.rate=3 N*mm/deg"], "springs.rate"),
        (["springs.lag=-1 s"], "springs.lag"),
        (["springs.adjustible=true"], "springs.adjustible"),
    ],
)
def test_a_wrong_actuator_is_named(changes, field):
    with pytest.raises((ParameterError, UnitError)) as caught:
        load_robot("aoi2022-planar").set_from_text(changes)
    assert caught.value.field == field


def test_springs_that_begin_outside_the_range_of_their_actuators_are_worth_a_remark():
    robot = load_robot("aoi2022-planar").set_from_text([*ACTUATED, "springs.stiffest=40 N*mm/deg"])
    assert remarks(robot)[0] == "Springs 1 begin outside the range of their actuators."
    assert not any("range" in each for each in remarks(load_robot("aoi2022-planar").set_from_text(ACTUATED)))
