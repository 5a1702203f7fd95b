"""`chilopod stability` and `chilopod bifurcation` as a user and as a hostile user meet them."""

import json
import sys
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from chilopod import planar
from chilopod.cli import main
from helpers.command_line import printed, remarks, run

PRESET = "aoi2022-planar"
K1 = "springs.stiffness[0]"
WIDE = ("2 N*mm/deg", "75 N*mm/deg")


def bifurcation(*extra, parameter=K1, between=WIDE):
    return run("bifurcation", PRESET, "--parameter", parameter, "--between", *between, *extra)


def test_stability_json_has_all_reduced_exponents_by_falling_real_part():
    code, out, err = run("stability", PRESET, "--json")
    result = json.loads(out)
    assert (code, remarks(err)) == (0, [])
    assert set(result) == {
        "robot", "period_s", "stable", "verdict", "exponents_per_s", "multipliers", "half_period_multipliers",
        "error_estimate", "modes",
    }  # fmt: skip
    real = [exponent[0] for exponent in result["exponents_per_s"]]
    assert (
        len(real) == len(result["multipliers"]) == len(result["half_period_multipliers"]) == len(result["modes"]) == 13
    )
    assert real == sorted(real, reverse=True)
    assert result["stable"] is True
    assert 0 < result["error_estimate"] < 1e-9
    for mode in result["modes"]:
        assert len(mode["joint_components"]) == 5


def test_stability_changes_where_the_paper_says():
    verdicts = {}
    for k1 in ("11 N*mm/deg", "13 N*mm/deg"):
        _, out, _ = run("stability", PRESET, "--json", "--set", f"{K1}={k1}")
        verdicts[k1] = json.loads(out)["stable"]
    assert verdicts == {"11 N*mm/deg": False, "13 N*mm/deg": True}


def test_without_the_symmetry_there_are_no_half_period_multipliers():
    code, out, _ = run("stability", PRESET, "--json", "--set", "gait.side_phase=150 deg")
    assert code == 0
    assert json.loads(out)["half_period_multipliers"] is None


def test_bifurcation_json_names_the_pitchfork():
    code, out, err = bifurcation("--json")
    (point,) = json.loads(out)["points"]
    assert (code, remarks(err)) == (0, [])
    assert point["kind"] == "pitchfork"
    assert point["parameter"] == K1
    assert point["unit"] == "N*mm/deg"
    assert point["value"] == pytest.approx(11.9914, abs=1e-4)
    assert point["value_si"] == pytest.approx(point["value"] * 1e-3 * 57.29577951308232)
    assert point["joint_components"] == pytest.approx([0.638, 0.360, 0.476, 0.459, 0.159], abs=1e-3)
    assert sum(component**2 for component in point["joint_components"]) == pytest.approx(1.0)
    assert 0 < point["error_bound_si"] < 1e-9
    assert point["criticality"] == "supercritical"
    assert point["coefficient"] < 0
    assert point["frequency_rad_s"] == 0


def test_springs_are_searched_where_they_may_be_critical():
    """Of a robot ten times as fast, with springs as much stiffer, too."""
    fast = ["--set", "gait.stance=31 ms", "--set", "gait.swing=29 ms", "--set", "springs.stiffness[1:]=410 N*mm/deg"]
    code, out, _ = run("bifurcation", PRESET, "--parameter", K1, *fast, "--json")
    (point,) = json.loads(out)["points"]
    assert (code, point["kind"]) == (0, "pitchfork")
    assert 10.0 * 11.0 < point["value"] < 10.0 * 13.0
    code, _, err = run("bifurcation", PRESET, "--parameter", "legs.half_width")
    assert (code, err) == (2, "error: --between: must be given for legs.half_width\n")


def test_uniform_springs_give_the_neimark_sacker_point():
    _, out, _ = bifurcation("--json", parameter="springs.stiffness", between=("6 N*mm/deg", "7 N*mm/deg"))
    (point,) = json.loads(out)["points"]
    assert point["kind"] == "Neimark-Sacker"
    assert point["value"] == pytest.approx(6.5359, abs=1e-4)
    assert point["frequency_rad_s"] == pytest.approx(0.5664, abs=1e-4)
    assert all(len(component) == 2 for component in point["joint_components"])


def test_no_crossing_is_an_empty_list_and_it_says_so():
    stiff = ("20 N*mm/deg", "75 N*mm/deg")
    code, out, _ = bifurcation("--json", between=stiff)
    assert code == 0
    assert json.loads(out) == {"robot": PRESET, "points": [], "complete": True}
    code, out, _ = bifurcation(between=stiff)
    assert code == 0
    assert "no bifurcation" in out


def test_the_symmetry_of_the_gait_itself_may_vary():
    code, out, _ = bifurcation("--json", parameter="gait.side_phase", between=("170 deg", "190 deg"))
    assert code == 0
    assert json.loads(out) == {"robot": PRESET, "points": [], "complete": True}


def test_out_holds_what_json_prints(tmp_path):
    _, out, err = bifurcation("--json", "--out", tmp_path / "new")
    assert json.loads((tmp_path / "new" / "bifurcation.json").read_text()) == json.loads(out)
    assert "bifurcation.json" in err


@pytest.mark.parametrize(
    ("parameter", "between", "expected"),
    [
        ("springs.stifness[0]", WIDE, "springs.stiffness"),
        ("springs.stiffness[9]", WIDE, "springs.stiffness"),
        ("name", WIDE, "name"),
        ("body.modules", ("3", "9"), "body.modules"),
        (K1, ("75 N*mm/deg", "2 N*mm/deg"), "between"),
        (K1, ("2 N*mm/deg", "2 N*mm/deg"), "between"),
        (K1, ("2 kg", "75 kg"), "2 kg"),
        (K1, ("nan", "1"), "nan"),
        (K1, ("-1 N*mm/deg", "75 N*mm/deg"), "stiffness"),
        (K1, ("", "75 N*mm/deg"), "''"),
    ],
)
def test_bad_input_is_one_line_that_names_it(parameter, between, expected):
    code, out, err = bifurcation(parameter=parameter, between=between)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert expected in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ((PRESET, "--engine", "twin"), "the table [twin] must be given"),
        ((PRESET, "--engine", "twn"), "did you mean 'twin'?"),
        (("aoi2022", "--engine", "mine:engine"), "has no state that can be divided by its place"),
        (("aoi2022", "--engine", "twin", "--amplitude", "3 deg/s"), "--amplitude"),
        (("aoi2022", "--engine", "twin", "--amplitude", "3 rad"), "must be a small angle"),
        (
            ("aoi2022", "--engine", "twin", "--amplitude", "0 deg"),
            "= '0 deg': must be a small angle; allowed: 1e-08 rad",
        ),
        (("aoi2022", "--engine", "twin", "--amplitude", "1e-9 rad"), "must be a small angle; allowed: 1e-08 rad"),
        ((PRESET, "--onset", K1, "5 N*mm/deg", "30 N*mm/deg"), "must be 'twin' for --onset"),
        (
            ("aoi2022", "--engine", "twin", "--onset", K1, "75 N*mm/deg", "20 N*mm/deg"),
            f"--onset = '{K1} 75 N*mm/deg 20",
        ),
        (("aoi2022", "--engine", "twin", "--onset", "springs.k", "2", "3"), "--onset = 'springs.k"),
        (("aoi2022", "--engine", "twin", "--onset", K1, "2 kg", "3"), f"--onset {K1} = '2 kg': is a mass"),
        ((PRESET, "--amplitude", "2 deg"), "must be 'twin' for --amplitude"),
        ((PRESET, "--amplitude", "1 deg"), "must be 'twin' for --amplitude"),
        (("aoi2022", "--engine", "twin", "--amplitude", ""), "--amplitude = ''"),
    ],
)
def test_an_engine_without_multipliers_is_one_line_that_names_it(arguments, expected, monkeypatch):
    monkeypatch.setitem(sys.modules, "mine", SimpleNamespace(engine=planar))
    code, out, err = run("stability", *arguments)
    assert (code, out) == (2, "")
    assert expected in err.splitlines()[-1]


def test_an_unwritable_folder_is_refused_before_any_work(tmp_path):
    (tmp_path / "file").write_text("")
    code, out, err = bifurcation("--out", tmp_path / "file" / "below")
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1


def test_a_search_without_time_says_so():
    assert bifurcation("--seconds", "0") == (2, "", "error: --seconds = 0.0: the time limit is reached\n")


# A hostile user: whatever stands in the arguments, one line and exit code 2, or an answer.
_TEXTS = st.text(max_size=30)
_QUANTITIES = st.one_of(
    _TEXTS,
    st.floats().map(str),
    st.builds("{} {}".format, st.floats(), st.sampled_from(["N*mm/deg", "kg", "N*m/rad", "deg", "s", "1/0", "m**9"])),
)
_PATHS = st.one_of(
    _TEXTS,
    st.sampled_from([K1, "springs.stiffness[-1]", "springs", "twin", "gait.stride", "body.length", "ground.friction"]),
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(parameter=_PATHS, low=_QUANTITIES, high=_QUANTITIES)
@example(parameter="body.length", low="1e9 m", high="1e10 m")
@example(parameter=K1, low="1e-12", high="1e9")
@example(parameter="gait.stride", low="1 um", high="1 km")
def test_random_arguments_never_end_in_a_traceback(parameter, low, high):
    search = ("bifurcation", PRESET, f"--parameter={parameter}", "--seconds", "0.1", "--between", low, high)
    code, out, err = run(*search)
    assert code in (0, 2)
    assert "Traceback" not in err
    if code == 2:
        assert out == ""
        assert len(err.splitlines()) == 1


@pytest.mark.parametrize("command", ["bifurcation", "branch"])
def test_numbers_without_a_unit_are_said_to_be_si(command):
    code, out, err = run(command, PRESET, "--parameter", K1, "--between", "2", "75")
    note = "note: a number without a unit is SI: --between is 2 N*m/rad to 75 N*m/rad, that is 34.91 N*mm/deg to 1309"
    assert err.startswith(note)
    if command == "bifurcation":
        assert code == 0
        assert "no bifurcation of the straight walk for springs.stiffness[0] between 34.9066 N*mm/deg and 1309" in out
    else:
        assert code == 2
        said = "--between springs.stiffness[0] = '34.91 N*mm/deg to 1309 N*mm/deg': the straight walk has no pitchfork"
        allowed = "allowed: an interval around a pitchfork; `chilopod bifurcation` lists where the walk bends"
        assert err.splitlines()[-1] == f"error: {said} in this interval; {allowed}"
    for between in (("0.2", "75 N*mm/deg"), ("11 N*mm/deg", "13 N*mm/deg")):
        _, _, err = bifurcation(between=between)
        assert ("note: a number without a unit is SI" in err) is (between[0] == "0.2")


def test_what_the_errors_leave_undecided_is_said_so(capsys):
    """Every exponent is negative, and the bound is larger than the distance to 1."""
    arguments = ["stability", "aoi2022-planar", "--set", "body.length=1e5 m"]
    assert main(arguments) == 0
    out = capsys.readouterr().out
    assert "the straight walk is undecided" in out
    assert "the largest is nearer to 1 than that" in out
    result = printed(*arguments, "--json")
    assert (result["stable"], result["verdict"]) == (None, "undecided")
    result = printed("stability", "aoi2022-planar", "--json")
    assert (result["stable"], result["verdict"]) == (True, "stable")
