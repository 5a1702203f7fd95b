"""Results print as a few lines, are drawn, and are tables; what users receive they can import."""

import inspect
import io
import math
import typing
from dataclasses import fields, is_dataclass, replace
from functools import cache

import matplotlib.axes
import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from chilopod import stability
from chilopod.errors import OutputError, ParameterError
from chilopod.stability import (
    Criticality,
    Ending,
    Kind,
    SymmetricKind,
    begin,
    exponents,
    find_orbit,
    follow,
    follow2,
    from_rhs,
    locate,
    multipliers,
)
from chilopod.stability.branches import inspection
from chilopod.stability.shown import bounded
from chilopod.stability.unit_circle.crossings import find_crossings
from helpers.systems import henon, of_map


def logistic(p):
    """x -> p x (1 - x)."""
    return of_map(lambda x: (p * x * (1.0 - x), np.diag(p * (1.0 - 2.0 * x))))


def folding(p):
    """x -> x + 0.2 (p + x - x^3), with folds at p = -+2 / 27^0.5."""
    return of_map(lambda x: (x + 0.2 * (p + x - x**3), np.eye(1) * (1.2 - 0.6 * x[0] ** 2)))


FOLD = 2.0 / 27.0**0.5


@cache
def folded():
    return follow(folding, begin(folding, -1.0, [-1.3]), (-1.0, 1.0))


@cache
def doubling():
    """The fixed point 1 - 1/p from where it becomes stable to where it no longer is."""
    return follow(logistic, begin(logistic, 1.5, [1.0 / 3.0]), (1.5, 3.6))


@cache
def located():
    return locate(logistic, (-1.5, 3.6), orbit=[0.0])


@cache
def curve():
    (point,) = locate(lambda a: henon(a, 0.3), (0.1, 0.8), orbit=[0.8, 0.24])
    return follow2(henon, point, ((0.05, 5.0), (-1.4, 0.7)), second=0.3)


@cache
def some_multipliers():
    return multipliers(henon(0.5, 0.3), [0.6, 0.2])


RESULTS = pytest.mark.parametrize("result", [folded, doubling, located, curve, some_multipliers])


def test_a_branch_prints_what_is_on_it():
    text, point = str(doubling()), doubling().special_points[0].bifurcation
    assert text.splitlines() == [
        f"Branch: {len(doubling().points)} points between 1.5 and 3.6, periods: 1",
        "ends: the parameter reached an end of the interval",
        "special points:",
        f"  period doubling  {bounded(point.value, point.error_bound)}  supercritical",
        "stability along it:",
        "  stable    1.5 to 3",
        "  unstable  3 to 3.6",
    ]
    lost = replace(doubling(), ending=Ending.LOST, reason="the step went astray", remarks=("word",) * 9)
    assert "could not be followed further (the step went astray)" in str(lost)
    assert str(lost).endswith("and 3 more remarks")
    long = str(replace(lost, remarks=("word " * 60,) * 9))
    assert (long.count("\n") + 1, long.endswith("and 12 more lines")) == (15, True)
    assert max(map(len, str(lost).splitlines())) <= 110


def test_stretches_of_a_branch_end_at_folds():
    lines = str(folded()).splitlines()
    assert lines[lines.index("stability along it:") + 1 :] == [
        "  stable    -1 to 0.384900179",
        "  unstable  0.384900179 to -0.384900179",
        "  stable    -0.384900179 to 1",
    ]
    # Without a fold, as where a bubble of doubled orbits passes its other end, a stretch may turn back.
    part = [replace(each, special=None, multipliers=np.array([0.5])) for each in folded().points]
    part = part[: 1 + max(i for i, each in enumerate(folded().points) if each.special is Kind.FOLD)]
    (turned,) = (line for line in str(replace(folded(), points=tuple(part))).splitlines() if "  stable" in line)
    assert turned.startswith("  stable  -1 to 0.384900179 and back to -0.384900179")
    # One that is unstable on both sides of a fold does not go straight from one end to the other.
    off = [replace(each, multipliers=np.append(1.5, each.multipliers)) for each in folded().points]
    assert str(replace(folded(), points=tuple(off))).count("unstable") == 3


def test_a_branch_of_one_point_prints():
    (first, *_) = doubling().points
    assert "  stable  1.5 to 1.5" in str(replace(doubling(), points=(first,)))


def test_located_points_print():
    assert [line.split("  ") for line in str(located()).splitlines()[1:]] == [
        [f"searched: -1.5 to 3.6, at {located().evaluations} values, at most {located().spacing:.2g} apart"],
        ["", "period doubling", bounded(located()[0].value, located()[0].error_bound), "supercritical"],
        ["", "transcritical", "", bounded(located()[1].value, located()[1].error_bound)],
    ]
    assert "Located: 0 bifurcations" in str(locate(logistic, (0.1, 0.2), orbit=[0.0]))
    assert str(located()[0]).startswith("BifurcationPoint: period doubling at -1 ± ")
    assert "1:2 resonance  3 ± " in str(curve())


def test_spectra_and_orbits_print():
    system = from_rhs(lambda t, x: [x[1], -0.2 * x[1] - 4.0 * x[0] + np.cos(t)], 2, 2.0 * np.pi)
    heading, first, second = str(multipliers(system, [0.3, 0.1])).splitlines()
    assert heading.startswith("Multipliers: 2 of an orbit of period 6.2831")
    assert heading.endswith("stable")
    assert f"modulus {np.exp(-0.2 * np.pi):.9g}" in first
    assert "+" in first.partition("±")[0]
    assert "-" in second.partition("±")[0]
    assert str(exponents(system, [0.3, 0.1])).splitlines()[1].strip().startswith("-0.1+")
    assert str(find_orbit(system, [0.3, 0.1])).startswith("Orbit: period 6.283185307, 1 return in it")


def test_the_searched_interval_is_drawn():
    axes = Figure().add_subplot()
    located().plot(axes)
    assert axes.get_xlim() == located().searched


@RESULTS
def test_a_result_is_drawn(result):
    axes = Figure().add_subplot()
    assert result().plot(axes) is axes
    own = result().plot()
    assert isinstance(own, matplotlib.axes.Axes)
    assert own.figure.number in plt.get_fignums()
    with pytest.raises(ParameterError, match="axes = 3"):
        result().plot(3)


def drawn(axes, style):
    return [line.get_xydata() for line in axes.lines if line.get_linestyle() == style]


def test_stable_stretches_are_solid_and_special_points_marked():
    axes = folded().plot(Figure().add_subplot())
    first, last = drawn(axes, "-")
    (between,) = drawn(axes, "--")
    assert [first[0, 0], last[-1, 0]] == [-1.0, 1.0]
    np.testing.assert_array_equal(first[-1], between[0])
    np.testing.assert_array_equal(between[-1], last[0])
    (marks,) = drawn(axes, "None")
    np.testing.assert_allclose(marks, [[FOLD, -(3.0**-0.5)], [-FOLD, 3.0**-0.5]], atol=1e-7)
    assert len({line.get_color() for line in axes.lines}) == 2  # of the branch, and of its marks
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["stable", "unstable", "fold"]


def test_several_branches_share_axes_and_marks():
    axes = Figure().add_subplot()
    follow(logistic, begin(logistic, -1.4, [0.0]), (-1.4, 3.6)).plot(axes)
    doubling().plot(axes)
    folded().plot(axes)
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert sorted(labels) == ["fold", "period doubling", "stable", "transcritical", "unstable"]
    markers = {(line.get_label(), line.get_marker()) for line in axes.lines if line.get_linestyle() == "None"}
    assert len(markers) == len(dict(markers)) == len({marker for _, marker in markers}) == 3


def test_a_state_that_is_not_there_is_refused_in_one_line():
    with pytest.raises(ParameterError, match=r"^state = 1: must be a state; allowed: 0 to 0$"):
        folded().plot(Figure().add_subplot(), state=1)


def test_multipliers_are_told_apart_by_the_circle():
    axes = some_multipliers().plot(Figure().add_subplot())
    circle, inside, outside = (line.get_xydata() for line in axes.lines)
    np.testing.assert_allclose(np.hypot(*circle.T), 1.0)
    assert (np.hypot(*inside.T) < 1.0).all()
    assert outside.shape == (1, 2)
    assert axes.get_title() == "unstable: 1 of 2 outside"


@RESULTS
def test_a_dataset_has_types_units_and_names_and_can_be_kept(result, tmp_path):
    data = result().to_dataset()
    for each in data.data_vars.values():
        assert set(each.attrs) == {"long_name", "units"}
        assert each.dtype.kind in "fiU"
        assert (each.dtype.kind == "U") is (each.attrs["units"] == "")
    data.to_netcdf(tmp_path / "kept.nc", engine="h5netcdf")
    xr.testing.assert_identical(xr.load_dataset(tmp_path / "kept.nc", engine="h5netcdf").astype(data.dtypes), data)


@RESULTS
def test_a_table_as_text_has_the_numbers_to_the_last_bit(result, tmp_path):
    data = result().to_dataset()
    path = tmp_path / "table.csv"
    text = result().to_csv(path)
    assert path.read_text(encoding="utf-8") == text
    header, *lines = (line.split(",") for line in text.splitlines() if not line.startswith("#"))
    columns = dict(zip(header, zip(*lines, strict=True), strict=True))
    for name, each in data.data_vars.items():
        found = columns[name] if each.ndim == 1 else [columns[f"{name}[{i}]"] for i in range(each.shape[1])]
        np.testing.assert_array_equal(np.array(found).astype(each.dtype).T, each.values)
    assert all(f"# {name}: " in text for name in (*data.attrs, *data.data_vars))
    for wrong in (tmp_path, tmp_path / "new" / "table.csv"):
        with pytest.raises(OutputError):
            result().to_csv(wrong)
    assert not wrong.parent.exists()
    with pytest.raises(ParameterError, match="must be a path"):
        result().to_csv(5)


def test_special_points_are_marked_in_tables():
    data = folded().to_dataset()
    special = data.isel(point=data.special.values == "fold")
    np.testing.assert_allclose(special.value, [FOLD, -FOLD], atol=1e-12)
    assert (np.abs(special.value - [FOLD, -FOLD]) <= special.value_error_bound).all()
    assert special.criticality.values.tolist() == ["not defined"] * 2
    assert special.verdict.values.tolist() == ["undecided"] * 2
    assert np.isnan(data.value_error_bound[data.special == ""]).all()
    assert data.multipliers_error_bound.values.tolist() == [point.error_bound for point in folded().points]
    assert "of the multipliers" in data.multipliers_error_bound.long_name
    two = curve().to_dataset()
    (at,) = np.flatnonzero(two.special == "1:2 resonance")
    np.testing.assert_allclose(two["values"][at], [3.0, -1.0], atol=1e-12)
    # In its place along the curve: the second parameter rises throughout.
    assert (np.diff(two["values"][:, 1]) > 0.0).all()


def test_tables_have_what_their_results_have():
    """Multipliers of a return without a symmetry in time, and errors of coefficients along a branch."""
    assert some_multipliers().half_period is None
    assert "half_period" not in some_multipliers().to_csv()
    assert "half_period_real" in replace(some_multipliers(), half_period=some_multipliers().values).to_dataset()
    (point,), data = doubling().special_points, doubling().to_dataset()
    at = data.special.values == "period doubling"
    assert data.coefficient.values[at] == point.bifurcation.coefficient
    assert data.coefficient_error.values[at] == point.bifurcation.coefficient_error


def test_a_table_of_nothing_has_the_same_columns():
    empty, some = locate(logistic, (0.1, 0.2), orbit=[0.0]), located()
    assert empty.to_dataset().sizes["point"] == 0
    assert set(empty.to_dataset()) == set(some.to_dataset())
    tables = [found.to_csv().partition("value,error_bound,")[2].partition("\n")[0] for found in (empty, some)]
    assert tables[0] == tables[1]
    assert [str(each.dtype)[:2] for each in empty.to_dataset().values()] == [
        str(each.dtype)[:2] for each in some.to_dataset().values()
    ]
    empty.plot(Figure().add_subplot())


def test_a_table_is_read_by_others():
    pandas = pytest.importorskip("pandas")
    frame = pandas.read_csv(io.StringIO(folded().to_csv()), comment="#")
    assert frame.value.iloc[0] == -1.0
    assert frame.special.dropna().tolist() == ["fold", "fold"]


def test_every_point_has_a_criticality():
    """Where no coefficient decides, and where none was computed, as well."""
    assert located()[1].kind is Kind.TRANSCRITICAL
    assert located()[1].criticality is Criticality.NOT_DEFINED
    for point in folded().special_points:
        assert point.bifurcation.criticality is Criticality.NOT_DEFINED
        assert point.bifurcation.criticality.label == "not defined"
    (point, _) = locate(logistic, (-1.5, 3.6), orbit=[0.0], normal_form=False)
    assert (point.kind, point.criticality) == (Kind.PERIOD_DOUBLING, Criticality.NOT_COMPUTED)
    assert point.criticality.known is False
    assert "has none" in Criticality.NOT_DEFINED.sentence
    assert [each.name for each in Criticality if each.known] == ["SUPERCRITICAL", "SUBCRITICAL", "UNDECIDED"]


@pytest.mark.parametrize("mirrored", [False, True])
def test_what_breaks_a_symmetry_in_time_doubles_no_period(mirrored):
    """Duffing's pitchfork, with cells that a spatial symmetry exchanges or without: -1 of the half period."""

    def family(force):
        def rhs(t, x):
            cell = [x[1], -0.2 * x[1] - x[0] ** 3 + force * np.cos(t)]
            return cell + ([x[3], -0.2 * x[3] - 9.0 * x[2]] if mirrored else [])

        more = {"spatial_symmetry": np.diag([1.0, 1.0, -1.0, -1.0])} if mirrored else {}
        size = 4 if mirrored else 2
        return from_rhs(rhs, size, 2.0 * np.pi, symmetry=-np.eye(size), **more)

    (point,) = locate(family, (2.3, 2.5), orbit=[1.9, 0.6, 0.0, 0.0][: 4 if mirrored else 2])
    assert point.kind is Kind.PITCHFORK
    assert point.multiplier.real == pytest.approx(-1.0)
    assert "twice" not in str(point)
    if mirrored:
        assert point.symmetry.kind is SymmetricKind.PITCHFORK


def test_a_branch_covers_its_interval():
    """By default; of a long way that takes more than a hundred steps."""
    between = (-1.0, 1.0)
    whole = follow(folding, begin(folding, -1.0, [-1.3]), between, longest=0.035)
    assert len(whole.points) > 100
    assert (whole.points[0].value, whole.points[-1].value) == between
    assert whole.ending is Ending.LEFT_INTERVAL
    part = follow(folding, begin(folding, -1.0, [-1.3]), between, longest=0.035, points=20)
    assert (part.ending, len(part.points)) == (Ending.ENOUGH_POINTS, 21)
    assert follow(folding, part, between, longest=0.035).points[-1].value == 1.0


def test_remarks_of_a_search_name_values_as_they_are_shown():
    def matrices(values):
        angle = np.where(values < 0.3, 0.5, 1.5)
        return angle[:, None, None] * np.eye(1), np.zeros(values.size)

    plain, shown = find_crossings(matrices, 0.0, 1.0), find_crossings(matrices, 0.0, 1.0, shown=lambda v: 100.0 + v)
    assert any("at 0.3" in remark for remark in plain.remarks)
    assert any("at 100.3" in remark for remark in shown.remarks)
    assert not any(" 0." in remark for remark in shown.remarks)


def test_remarks_of_a_branch_are_in_units_of_the_parameter(monkeypatch):
    """Not of the length of a step: two period doublings at once, which are searched for."""
    searched = []

    def search(matrices, low, high, **how):
        searched.append((how["shown"](low), how["shown"](high)))
        return find_crossings(matrices, low, high, **how)

    def family(p):
        return of_map(lambda x: (-p * x, -p * np.eye(2)), 2)

    monkeypatch.setattr(inspection, "find_crossings", search)
    branch = follow(family, begin(family, 0.9, [0.0, 0.0]), (0.9, 1.2))
    ordinary = [point.value for point in branch.points if point.special is None]
    assert searched
    for low, high in searched:
        np.testing.assert_allclose([low, high], ordinary[ordinary.index(high) - 1 :][:2], rtol=1e-12)


def parts(hint):
    if isinstance(hint, type):
        yield hint
    for each in typing.get_args(hint) + (tuple(hint) if isinstance(hint, list) else ()):
        yield from parts(each)


def received(value):
    """What a user gets from a function, or from a public attribute of an object."""
    local = {"xr": xr, "Axes": matplotlib.axes.Axes}
    if not isinstance(value, type):
        return typing.get_type_hints(value, localns=local).values() if inspect.isfunction(value) else ()
    found = list(typing.get_type_hints(value, localns=local).values())
    for name, each in vars(value).items():
        method = each.fget if isinstance(each, property) else getattr(each, "__func__", each)
        if not name.startswith("_") and inspect.isfunction(method):
            found.append(typing.get_type_hints(method, localns=local).get("return"))
    return found


def test_every_type_that_users_receive_can_be_imported():
    exported = [getattr(stability, name) for name in stability.__all__]
    missing = {
        f"{name}: {part}"
        for name in stability.__all__
        for hint in received(getattr(stability, name))
        for part in parts(hint)
        if part.__module__.startswith("chilopod.") and part not in exported
    }
    assert not missing
    # A comparison of fields that are arrays would raise.
    results = [
        each for each in exported if is_dataclass(each) and any("Array" in str(one.type)[:12] for one in fields(each))
    ]
    assert [each for each in results if each.__eq__ is not object.__eq__] == []
    assert len(results) > 10
    assert {"NormalForm", "NormalFormStatus", "SearchStatus", "SymmetricCrossing"} <= set(stability.__all__)


@pytest.mark.parametrize(
    ("value", "bound", "text"),
    [
        (4.73584815120351, 3.8e-13, "4.7358481512035 ± 3.9e-13"),
        (9.0620478560333879, 1.04e-12, "9.0620478560334 ± 1.1e-12"),
        (1.0 + 2.0**-52, 4.2e-15, "1 ± 4.5e-15"),
        (-2.5e8, 1e-12, "-250000000 ± 1.0e-12"),
        (0.1, 0.0, "0.1 ± 0.0e+00"),
        (math.nan, math.inf, "nan ± inf"),
    ],
)
def test_a_bound_holds_for_the_digits_beside_it(value, bound, text):
    assert bounded(value, bound) == text
