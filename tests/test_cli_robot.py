"""The commands of ``chilopod robot``, and what every command does with bad input."""

import importlib.metadata
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

import chilopod
from chilopod.robot import load_robot, presets
from helpers.command_line import remarks, run

PRESET = "aoi2022-planar"


def refused(*arguments: str) -> str:
    """Run what must be refused, and return the one line it says."""
    code, out, err = run(*arguments)
    assert code == 2
    assert out == ""
    assert err.startswith("error: ")
    assert err.endswith("\n")
    line = err.removesuffix("\n")
    assert line.isprintable()
    return line


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Iterator:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_help_names_the_commands():
    for arguments in ([], ["--help"]):
        code, out, err = run(*arguments)
        assert (code, remarks(err)) == (0, [])
        assert "robot" in out
    for arguments in (["robot"], ["robot", "--help"]):
        code, out, err = run(*arguments)
        assert (code, remarks(err)) == (0, [])
        assert "show" in out


def test_help_names_the_presets():
    for command in (["robot", "show"], ["walk"]):
        assert f"one of the presets {' and '.join(presets())}." in " ".join(run(*command, "--help")[1].split())


def test_version():
    assert chilopod.__version__.partition("+")[0] == importlib.metadata.version("chilopod")
    assert run("--version") == (0, f"chilopod {chilopod.__version__}\n", "")


def test_new_writes_a_robot_that_reads_back(folder):
    assert run("robot", "new", "mine.toml", "--modules", "8", "--set", "gait.stride=2 cm") == (
        0,
        "wrote mine.toml: 8 modules of 0.1688 m, 1.35 m in all\n",
        "",
    )
    robot = load_robot("mine.toml")
    assert robot.name == "mine"
    assert robot.body.modules == 8
    assert robot.gait.stride == 0.02
    assert os.listdir(folder) == ["mine.toml"]


def test_new_overwrites_only_when_told(folder):
    (folder / "mine.toml").write_text("precious")
    assert "mine.toml: exists" in refused("robot", "new", "mine.toml")
    assert (folder / "mine.toml").read_text() == "precious"
    code, out, _ = run("robot", "new", "mine.toml", "--force", "--json")
    assert code == 0
    size = "6 modules of 0.225 m, 1.35 m in all"
    assert json.loads(out) == {"robot": "mine", "file": "mine.toml", "size": size}
    assert load_robot("mine.toml").name == "mine"


def test_new_with_a_twin_walks_in_three_dimensions(folder):
    assert run("robot", "new", "whole.toml", "--twin", "--modules", "8", "--set", "twin.clearance=5 mm")[0] == 0
    whole, preset = load_robot("whole.toml"), load_robot("aoi2022")
    assert whole.twin == preset.with_value("twin.clearance", 0.005).twin
    assert whole.body.modules == 8
    assert whole.legs == preset.legs
    # A robot of one's own keeps all it has, and gets what it lacks.
    assert run("robot", "new", "flat.toml", "--set", "body.mass=9 kg")[0] == 0
    assert load_robot("flat.toml").twin is None
    assert run("robot", "new", "mine.toml", "--twin", "--preset", "flat.toml")[0] == 0
    mine = load_robot("mine.toml")
    assert (mine.body.mass, mine.twin) == (9.0, preset.twin)
    assert mine.provenance_of("twin.clearance") == f"copied from aoi2022: {preset.provenance_of('twin.clearance')}"
    said = load_robot(PRESET).provenance_of("legs.half_width")
    assert mine.provenance_of("legs.half_width") == f"copied from {PRESET}: {said}"
    assert mine.provenance_of("body.mass") == "set by override"
    assert run("robot", "new", "again.toml", "--twin", "--preset", "whole.toml")[0] == 0
    assert load_robot("again.toml").twin == whole.twin
    assert run("robot", "export", "mine.toml", "--out", "new/folder/mine.xml")[0] == 0
    assert run("robot", "new", "another/new/folder/mine.toml")[0] == 0


def test_new_with_lengths_of_modules_or_body(folder):
    assert run("robot", "new", "a.toml", "--modules", "10", "--module-length", "20 cm")[0] == 0
    assert load_robot("a.toml").body.length == pytest.approx(2.0)
    assert run("robot", "new", "b.toml", "--modules", "10", "--body-length", "2 m")[0] == 0
    assert load_robot("b.toml").module_length == pytest.approx(0.2)
    # An edited number with the provenance of the preset is remarked upon.
    file = folder / "b.toml"
    file.write_text(file.read_text().replace('mass = "8.5 kg"', 'mass = "9 kg"'))
    assert "not those of the preset, with its provenance: body.mass." in run("robot", "check", "b.toml")[1]


@pytest.mark.parametrize(
    "arguments",
    [
        ["x.toml", "--module-length", "1 m", "--body-length", "2 m"], ["x.toml", "--module-length", "1 kg"],
        ["."], ["x.toml", "--modules", "1"], ["x.toml", "--modules", "many"], ["x.toml", "--preset", "aoi2023"],
        ["x.toml", "--set", "gait.stride=3 kg"], ["\udcff.toml"], ["\x1b.toml"],
    ],
)  # fmt: skip
def test_new_leaves_nothing_behind_when_refused(folder, arguments):
    refused("robot", "new", *arguments)
    assert os.listdir(folder) == []


def test_show_prints_every_number_with_its_origin():
    code, out, err = run("robot", "show", PRESET, "--set", "springs.stiffness[0]=12 N*mm/deg")
    assert (code, remarks(err)) == (0, [])
    assert all(path in out for path in load_robot(PRESET).parameters())
    assert re.search(r"springs.stiffness\[0\] +12 N\*mm/deg +set by override\n", out)
    assert "identified here: chilopod identify planar" in out


def test_show_as_json():
    code, out, err = run("robot", "show", PRESET, "--json")
    assert (code, remarks(err)) == (0, [])
    shown = json.loads(out)
    assert shown["robot"] == PRESET
    spring = shown["parameters"]["springs.stiffness[0]"]
    assert spring["value"] == 41.0
    assert spring["unit"] == "N*mm/deg"
    assert spring["value_si"] == pytest.approx(2.34912696)
    assert shown["derived"]["speed"]["value_si"] == pytest.approx(0.03 / 0.31)


def test_check():
    assert run("robot", "check", PRESET) == (0, f"{PRESET}: valid, 6 modules\n", "")
    code, out, _ = run("robot", "check", PRESET, "--json", "--set", "gait.side_phase=0")
    assert code == 0
    assert json.loads(out)["valid"] is True
    assert "whole period" in json.loads(out)["remarks"][0]


@pytest.mark.parametrize(
    ("robot", "change", "said"),
    [
        (PRESET, "gait.stride=30 cm", "Legs of neighbouring modules collide"),
        (PRESET, "springs.stiffness[0]=3 N*mm/deg", "A joint bends beyond a right angle"),
        ("aoi2022", "twin.hip_height=13 cm", "cannot walk in three dimensions"),
    ],
)
def test_check_warns_of_walks_that_cannot_be(robot, change, said):
    assert said not in run("robot", "check", robot)[1]
    assert said in run("robot", "check", robot, "--set", change)[1]


def test_a_check_that_would_take_long_says_what_it_leaves_out(monkeypatch):
    monkeypatch.setattr("chilopod.cli.robot._PATIENCE", 0.0)
    code, out, _ = run("robot", "check", PRESET, "--set", "springs.stiffness[0]=3 N*mm/deg")
    assert (code, "more than 0 s to compute" in out) == (0, True)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["robot", "sho", PRESET], "No such command 'sho'"),
        (["robto"], "No such command 'robto'"),
        (["export"], "Did you mean robot export?"),
        (["walk", PRESET, "--seed", "-1"], "error: --seed = '-1': must be at least 0"),
        (["branch", "--between", "3"], "(see chilopod branch --help)"),
        (["branch", PRESET, "--parameter", "springs.stiffness[7]", "--between", "3", "4"], "allowed: 0 to 4"),
        (["walk", PRESET, "--out", "walk.csv"], "walk.csv: must end with .nc"),
        (["turn", PRESET, "--target", "0 deg, 1 m", "--k1", "autoo"], "did you mean 'auto'?"),
        (["robot", "show"], "Missing argument"),
        (["robot", "show", PRESET, "extra"], "extra"),
        (["robot", "show", PRESET, "--jsn"], "--jsn"),
        (["robot", "show", PRESET, "--set"], "--set"),
        (["--nope"], "--nope"),
        (["robot", "show", "aoi2022-planer"], "did you mean 'aoi2022-planar'?"),
        (["robot", "check", PRESET, "--set", "body.lenght=1"], "did you mean 'body.length'?"),
    ],
)
def test_mistakes_are_one_line(arguments, complaint):
    assert complaint in refused(*arguments)


hostile = st.text(max_size=30) | st.sampled_from(["--set", "--json", "--debug", "-", "--", "robot", "show", PRESET])


@given(st.lists(hostile.filter(lambda text: text != "--debug"), max_size=5))
def test_random_arguments(arguments):
    # `new` would write wherever the arguments say.
    if "new" not in arguments:
        code, _, err = run(*arguments)
        assert code in (0, 2)
        assert (code == 2) == bool(err)
        assert err.count("\n") <= 1


@given(
    st.sampled_from(
        ["", "gait.", "springs.", "springs.stiffness", "springs.stiffness[0]", "body.mass", "body.modules"]
    ),
    st.text(max_size=20),
    st.text("0123456789.e-+ Nmkgsdegra*/^()", max_size=15),
)
def test_random_overrides(stem, rest, value):
    code, out, err = run("robot", "show", PRESET, "--json", "--set", f"{stem}{rest}={value}")
    if code == 0:
        assert json.loads(out)["robot"] == PRESET
        assert err == ""
    else:
        assert (code, out) == (2, "")
        assert err.count("\n") == 1


def test_faults_of_our_own_show_no_traceback_unless_asked(monkeypatch):
    def broken(self, assignments):
        raise TypeError("two\nlines")

    monkeypatch.setattr("chilopod.robot.Robot.set_from_text", broken)
    code, out, err = run("robot", "show", PRESET)
    assert (code, out) == (1, "")
    assert err.count("\n") == 1
    assert "TypeError: two lines" in err
    with pytest.raises(TypeError):
        run("--debug", "robot", "show", PRESET)


def test_a_package_that_cannot_be_imported_is_named_with_what_the_environment_tells_it(monkeypatch, tmp_path):
    (tmp_path / "broken_package.py").write_text("raise ValueError('no\\nmore of it')")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("BROKEN_PACKAGE_THREADS", "0")
    monkeypatch.setattr("chilopod.robot.Robot.set_from_text", lambda *told: __import__("broken_package"))
    code, out, err = run("robot", "show", PRESET)
    assert (code, out) == (2, "")
    assert err.startswith("error: broken_package cannot be imported: ValueError: no (without BROKEN_PACKAGE_THREADS")
    assert err.count("\n") == 1


def python(*arguments: str, **keywords) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, *arguments], capture_output=True, timeout=60, check=False, **keywords)


def test_the_process_itself_ends_with_the_code():
    result = python("-m", "chilopod", "robot", "show", "nothing-like-it")
    assert result.returncode == 2
    assert result.stdout == b""
    assert result.stderr.count(b"\n") == 1


def test_odd_terminals_do_not_matter(folder):
    assert run("robot", "new", "µ.toml")[0] == 0
    result = python(
        "-m", "chilopod", "robot", "show", "µ.toml", env={**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "1"}
    )
    assert (result.returncode, result.stderr) == (0, b"")
    command = f"{sys.executable} -m chilopod robot show {PRESET}"
    closed = subprocess.run(["bash", "-c", f"{command} | true"], capture_output=True, timeout=60, check=False)
    assert closed.stderr == b""


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from chilopod.cli import main; found = set()\n"
        "for command, more in ([], {'numpy', 'pydantic'}), (['turn'], set()), (['course'], set()):\n"
        "    main([*command, '--help']); found |= {'scipy', 'numba', 'xarray', 'matplotlib', *more} & {*sys.modules}\n"
        "print(sorted(found), file=sys.stderr)"
    )
    assert python("-c", code).stderr.strip() == b"[]"
