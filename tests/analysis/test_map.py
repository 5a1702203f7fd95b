"""Maps of the straight walk over two numbers of a robot."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.optimize import root

from chilopod.analysis import bifurcations, curved_walks, map_curves, map_grid, straight_walk
from chilopod.analysis.growth import FATES, Fate
from chilopod.analysis.map import map as mapped
from chilopod.analysis.map_axes import Plane
from chilopod.analysis.map_curves import MapCurve, Search
from chilopod.analysis.map_grid import Grid
from chilopod.analysis.parameters import K1, stiffness
from chilopod.errors import AnalysisError, ChilopodError, OutputError, ParameterError
from chilopod.progress import silent
from chilopod.robot import load_robot
from chilopod.stability import CodimensionTwo, Kind
from chilopod.trials import NONE, Trial, run, summaries

from peer_model import N_MM_PER_DEG, flow, mirror, with_springs

ROBOT = load_robot("aoi2022-planar")
OTHERS = "springs.stiffness[1:]"
X, Y = (K1, "2.05 N*mm/deg", "2.45 N*mm/deg"), (OTHERS, "6.5 N*mm/deg", "6.9 N*mm/deg")
OFFSET = ("legs.forward_offset", "0 mm", "60 mm")


@pytest.fixture(scope="module")
def found():
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(map_curves, "_LONGEST", 0.1)  # the curves are nearly straight here
        return mapped(ROBOT, X, Y, points=49)


def test_curves_are_where_lines_across_them_change(found):
    assert [curve.kind for curve in found.curves].count(Kind.PITCHFORK) == 1
    assert {curve.kind for curve in found.curves} == {Kind.PITCHFORK, Kind.NEIMARK_SACKER}
    rng = np.random.default_rng(4)
    for curve in found.curves:
        # Lines along the axis that the curve crosses more steeply.
        inside = 1 + rng.choice(len(curve.values) - 2, 4, replace=False)
        for index in inside:
            along = np.abs(curve.values[index + 1] - curve.values[index - 1])
            p, q = (0, 1) if along[1] >= along[0] else (1, 0)
            paths, value = (K1, OTHERS), curve.values[index]
            beside = value[p] * np.array([1.0 - 1e-3, 1.0 + 1e-3])
            line = ROBOT.with_value(paths[q], value[q])
            points = bifurcations(line, paths[p], tuple(beside), normal_form=False)
            # Where two curves meet, both kinds are there.
            own = [at for at in points if at.point.kind is curve.kind]
            nearest = min(own, key=lambda at: abs(at.point.value - value[p]))
            bound = curve.error_bound[index]
            allowed = bound[p] + bound[q] * along[p] / along[q] + nearest.point.error_bound
            assert abs(nearest.point.value - value[p]) <= allowed


def test_pitchfork_and_pair_meet_where_another_model_has_both(found):
    (meeting,) = found.special
    assert meeting.kind is CodimensionTwo.PITCHFORK_NEIMARK_SACKER

    def conditions(springs):
        """Distances from -1 of the real multiplier and from 1 of the modulus of the pair, by the plain model."""
        robot = with_springs(*springs)
        nu = np.linalg.eigvals(mirror(robot) @ flow(robot, 0.5, reach=8.0))
        real, pair = nu[np.abs(nu.imag) < 1e-9].real, np.abs(nu[nu.imag > 1e-3])
        return [real[np.abs(real + 1.0).argmin()] + 1.0, pair[np.abs(pair - 1.0).argmin()] - 1.0]

    solved = root(conditions, [2.25, 6.7], tol=1e-13)
    assert solved.success
    np.testing.assert_allclose(meeting.values / N_MM_PER_DEG, solved.x, atol=0.0, rtol=1e-9)
    assert (np.abs(meeting.values - solved.x * N_MM_PER_DEG) < meeting.error_bound + 1e-11).all()


def test_every_value_is_on_its_side_of_the_curves_but_by_a_cell(found):
    search = Search(Plane.over(ROBOT, X, Y), Grid(Plane.over(ROBOT, X, Y), 49), False, silent, list(found.curves))
    near = np.zeros_like(found.computed)
    for j, i in np.argwhere(search.cells()):
        near[j : j + 2, i : i + 2] = True
    assert 0.05 < near.mean() < 0.5
    assert not found.computed.all()
    rng = np.random.default_rng(5)
    for j, i in rng.permutation(np.argwhere(~near))[:12]:
        walk = straight_walk(ROBOT.with_value(K1, found.x_values[i]).with_value(OTHERS, found.y_values[j]))
        assert bool(found.fate[j, i] == FATES.index(Fate.STRAIGHT)) is walk.stable
        assert found.unstable[j, i] == (walk.moduli > 1.0).sum()
        if found.computed[j, i]:
            assert found.growth[j, i] == pytest.approx(walk.exponents.values[0].real, rel=1e-9)
    # Neighbours differ only across a curve.
    differ = np.zeros(search.cells().shape, dtype=bool)
    for j, i in np.ndindex(differ.shape):
        differ[j, i] = len(set(found.unstable[j : j + 2, i : i + 2].ravel())) > 1
    assert not (differ & ~near[:-1, :-1]).any()


def test_places_that_no_curve_reaches_are_counted(monkeypatch):
    monkeypatch.setattr(map_curves, "_MOST", 0)
    found = mapped(ROBOT, X, Y, points=5)
    (remark,) = found.remarks
    assert remark.startswith("0 curves are followed; ")
    left = int(remark.split()[4])
    assert left > 0
    assert remark.endswith(" more places where a mode turns are left")


def test_it_is_shown_and_stored(found):
    assert str(found).count("\n") < 10
    assert "pitchfork-Neimark-Sacker" in str(found)
    data = found.to_dataset()
    assert data.growth.dims == ("y", "x")
    assert (data.x.attrs["units"], float(data.x[0]), float(data.y[-1])) == (
        "N*mm/deg",
        pytest.approx(2.05),
        pytest.approx(6.9),
    )
    assert data.sizes["point"] == sum(len(curve.values) for curve in found.curves)
    plain = found.as_json()
    assert sum(plain["shares"].values()) == pytest.approx(1.0)
    assert plain["special"][0]["values_si"] == found.special[0].values.tolist()
    for show in ("kind", "growth", "frequency", "criticality"):
        axes = found.plot(Figure().add_subplot(), show)
        assert axes.get_xlabel() == "springs.stiffness[0] (N·mm/deg)"
        named = [text.get_text() for text in axes.get_legend().get_texts()]
        curves = "curves" if show == "criticality" else "Neimark-Sacker"
        assert {"straight", "bends", "undulates", curves, "codimension two"} <= set(named)
    with pytest.raises(ChilopodError, match="did you mean 'growth'"):
        found.plot(Figure().add_subplot(), "grwth")


def test_radii_are_those_of_branches():
    """Of other continuations, each along its own row."""
    found = mapped(ROBOT, (K1, "9 N*mm/deg", "13 N*mm/deg"), ("body.mass", "8 kg", "9 kg"), points=5, also=["radius"])
    bends = found.fate == FATES.index(Fate.BENDS)
    assert bends.any()
    np.testing.assert_array_equal(np.isfinite(found.radius), bends)
    for j in (0, 4):
        robot = ROBOT.with_value("body.mass", found.y_values[j])
        walks = curved_walks(robot, K1, (found.x_values[0], found.x_values[-1]))
        assert found.radius[j, 0] == pytest.approx(float(walks.axis_radius[-1]), rel=1e-6)
    assert found.plot(Figure().add_subplot(), "radius").get_title() == "Radius of the curved walk (m)"
    assert found.to_dataset().radius.attrs["units"] == "m"
    with pytest.raises(ParameterError, match=r"^also = 'radii': must be a part of maps; did you mean 'radius'\?"):
        mapped(ROBOT, X, Y, also=["radii"])


@pytest.mark.parametrize(
    ("x", "y"),
    [
        (("ground.friction", 200.0, 300.0), (K1, "7 N*mm/deg", "15 N*mm/deg")),
        (("legs.half_width", "60 mm", "90 mm"), ("legs.forward_offset", "40 mm", "60 mm")),  # no onset is on this map
        (("modules", 5, 6), ("speed", "0.08 m/s", "0.1 m/s")),
    ],
)
def test_radii_do_not_depend_on_a_spring_on_the_horizontal_axis(x, y):
    robot = ROBOT.with_value(K1, stiffness(9.0))
    found = mapped(robot, x, y, points=2, also=["radius"])
    bends = found.fate == FATES.index(Fate.BENDS)
    assert bends[0, -1]
    np.testing.assert_array_equal(np.isfinite(found.radius), bends)
    assert found.remarks == ()
    there = Plane.over(robot, x, y).at(float(found.x_values[-1]), float(found.y_values[0]))
    walks = curved_walks(there, K1, (there.get(K1), stiffness(20.0)))
    assert found.radius[0, -1] == pytest.approx(float(walks.axis_radius[-1]), rel=1e-6)


def test_walks_that_bend_too_far_are_told_from_radii_that_are_not_found():
    found = mapped(ROBOT, (K1, "1 N*mm/deg", "9 N*mm/deg"), ("body.mass", "8 kg", "9 kg"), points=2, also=["radius"])
    assert np.isfinite(found.radius).tolist() == [[False, True], [False, True]]
    assert found.remarks == ("at 2 of 4 values the curved walk bends a joint by more than a right angle: no radius",)


def test_radii_of_a_tiny_map_are_those_of_the_square_root_law():
    """Beside the onset the inverse of their square is linear, and rounding moves the walks by more than elsewhere."""
    (onset,) = bifurcations(ROBOT, K1, (stiffness(11.0), stiffness(13.0)), normal_form=False)
    k1 = onset.point.value * (1.0 + 1e-6 * np.array([-1.0, 1.0]))
    mass = ROBOT.get("body.mass")
    found = mapped(ROBOT, (K1, *k1), ("body.mass", mass, mass * (1.0 + 1e-12)), points=9, also=["radius"])
    bends = found.x_values < onset.point.value * (1.0 - 1e-7)
    inverse = found.radius[0, bends] ** -2
    assert found.remarks == ()
    np.testing.assert_allclose(
        inverse, np.polyval(np.polyfit(found.x_values[bends], inverse, 1), found.x_values[bends]), rtol=1e-3
    )


def test_why_a_gait_without_mirror_symmetry_has_no_radius_is_said():
    robot = ROBOT.with_value("gait.side_phase", np.deg2rad(150.0))
    found = mapped(robot, (K1, "8 N*mm/deg", "9 N*mm/deg"), ("body.mass", "8 kg", "9 kg"), points=5, also=["radius"])
    (remark,) = found.remarks
    assert remark.startswith("at 25 of 25 values the onset is transcritical, and no pair of mirrored walks leaves it")


def test_radii_are_corrected_from_the_gait_with_mirror_symmetry():
    """That of a right turn, to which a walk settles."""
    phases = np.deg2rad([172.5, 187.5])
    axes = (K1, "8 N*mm/deg", "10 N*mm/deg"), ("gait.side_phase", *phases)
    found = mapped(ROBOT, *axes, points=3, also=["radius"])
    assert np.isfinite(found.radius).all()
    assert found.remarks == ()
    robot = ROBOT.with_value("gait.side_phase", phases[0]).with_value(K1, found.x_values[-1])
    (record,) = run([Trial(robot, 200.0, joint_angles=(0.1,), disturbance=NONE, rate=20.0)])
    assert summaries(robot, record)[0].axis_radius == pytest.approx(found.radius[0, -1], rel=1e-3)


def test_a_curve_beside_another_that_does_not_explain_its_edges_is_followed():
    """Neimark-Sacker points beside a pitchfork, in a corner: two multipliers are unstable, 0 to the right, 1 above."""
    numbers = {"body.modules": 3, "body.mass": 0.01, "body.length": 0.09, "legs.forward_offset": 0.006}
    numbers |= {"legs.half_width": 0.01, "gait.stride": 0.004, "ground.friction": 2.0}
    robot = ROBOT
    for path, value in numbers.items():
        robot = robot.with_value(path, value)
    ends = stiffness(0.0005), stiffness(0.001421875)
    found = mapped(robot, (K1, *ends), ("springs.stiffness[1]", *ends), points=3)
    assert found.unstable[:2, :2].tolist() == [[2, 0], [1, 0]]
    assert sorted(curve.kind.label for curve in found.curves) == ["Neimark-Sacker", "pitchfork"]
    curve = found.curves[[each.kind for each in found.curves].index(Kind.NEIMARK_SACKER)]
    for (a, b), error in zip(curve.values, curve.error_bound, strict=True):
        line = robot.with_value("springs.stiffness[1]", b)
        points = bifurcations(line, K1, (0.98 * a, 1.02 * a), normal_form=False)
        near = [each.point for each in points if each.point.kind is Kind.NEIMARK_SACKER]
        assert min(abs(each.value - a) for each in near) <= 1e-6 * a + 10.0 * error.max()


def test_why_a_computation_failed_is_said():
    found = mapped(ROBOT, ("gait.stance", "1 h", "2 h"), ("body.mass", 8.0, 9.0), points=2)
    assert {FATES[index] for index in found.fate.ravel()} == {Fate.FAILED}
    (remark,) = found.remarks
    assert remark.startswith("at 4 of the values the computation failed: the motion is too fast to follow")


def test_folds_begin_where_the_pitchfork_turns(monkeypatch):
    given = []

    def without_fold(family, point, between):
        given.append((family(*point.values).robot.get(K1), point.kind, between))
        raise AnalysisError("no fold is near")

    monkeypatch.setattr(map_curves, "switch2", without_fold)
    monkeypatch.setattr(map_curves, "_LONGEST", 0.2)
    ranges = (0.675, 0.686), (0.0474, 0.0482)
    found = mapped(ROBOT, (K1, *ranges[0]), (OFFSET[0], *ranges[1]), points=3, also=["folds"])
    (curve,), ((k1, kind, between),) = found.curves, given
    assert (kind, between) == (CodimensionTwo.DEGENERATE_PITCHFORK, ranges)
    assert curve.special[0].values[0] == k1
    assert found.remarks == ("a curve that begins at a pitchfork is not followed to its end: no fold is near",)


def test_a_fold_begins_at_the_point_where_the_pitchfork_turns(monkeypatch):
    """There no gap is left between both curves; the fold is made up of the pitchfork's own curve."""
    whole, followed = map_curves.follow2, []

    def either(family, begin, **how):
        followed.append(whole(family, begin, **how) if begin is not None else followed[0])
        return followed[-1]

    monkeypatch.setattr(map_curves, "switch2", lambda *given: [None])
    monkeypatch.setattr(map_curves, "follow2", either)
    monkeypatch.setattr(map_curves, "_LONGEST", 0.2)
    found = mapped(ROBOT, (K1, 0.675, 0.686), (OFFSET[0], 0.0474, 0.0482), points=3, also=["folds"])
    pitchfork, fold = found.curves
    np.testing.assert_array_equal(fold.values, [pitchfork.special[0].values, *pitchfork.values])
    assert fold.error_bound.shape == fold.values.shape
    assert np.isnan(fold.coefficient[0])


@pytest.fixture(scope="module")
def subcritical():
    """A robot of three modules whose pitchfork is subcritical, far from where it turns; an axis; the fold on it."""
    numbers = {"body.modules": 3, "body.length": 0.45, "body.mass": 2.325, "springs.damping": 0.02}
    numbers |= {"legs.forward_offset": 0.031, "gait.stride": 0.022, "gait.module_phase": np.deg2rad(77.0)}
    robot = ROBOT
    for path, number in {**numbers, "springs.stiffness[1]": stiffness(20.0)}.items():
        robot = robot.with_value(path, number)
    walks = curved_walks(robot, K1, (stiffness(3.0), stiffness(6.0)), points=12)
    (fold,) = walks.parameter_si.values[walks.special == Kind.FOLD.label]
    return robot, (K1, stiffness(3.0), stiffness(6.0)), fold


def test_folds_at_numbers_of_modules_are_those_of_branches(subcritical, monkeypatch):
    robot, x, there = subcritical
    found = mapped(robot, x, ("modules", 2, 3), points=9, also=["folds"])
    (fold,) = (curve for curve in found.curves if curve.kind is Kind.FOLD)
    assert abs(fold.values[0, 0] - there) <= 2.0 * fold.error_bound[0, 0]
    between = (found.x_values > found.curves[0].values[0, 0]) & (found.x_values < there)
    np.testing.assert_array_equal(found.folded, [np.full(9, np.nan), between])  # two modules bend at no such spring
    assert between.any()
    monkeypatch.setattr(map_curves, "_PIECES", 0)
    lost = mapped(robot, x, ("modules", 2, 3), points=9, also=["folds"])
    assert lost.remarks == ("the pitchfork is subcritical at 1 points, but its folds were not found",)
    assert lost.as_json()["folded_share"] is None


def test_folds_of_a_pitchfork_that_turns_nowhere_on_the_map(subcritical, monkeypatch):
    """From a branch of curved walks; a part in a thousand of the mass does not matter."""
    robot, x, there = subcritical
    monkeypatch.setattr(map_curves, "_LONGEST", 0.5)
    monkeypatch.setattr(map_curves, "_FOLD_POINTS", 1)
    found = mapped(robot, x, ("body.mass", 2.325, 2.327), points=3, also=["folds"])
    pitchfork, folds = found.curves
    assert (pitchfork.kind, pitchfork.special, folds.kind) == (Kind.PITCHFORK, (), Kind.FOLD)
    np.testing.assert_allclose(folds.values[:, 0], there, rtol=1e-5)
    assert folds.values[:, 0].min() > pitchfork.values[:, 0].max() * 1.2


def test_between_a_fold_and_a_subcritical_pitchfork_curved_walks_exist_too():
    # Two lines that meet at k1 = 10, an offset of 50 mm; the pitchfork is subcritical below.
    found = mapped(ROBOT, (K1, "9.04 N*mm/deg", "11 N*mm/deg"), (OFFSET[0], "31 mm", "72 mm"), points=9)
    offsets = np.linspace(0.025, 0.075, 11)
    lines = [
        np.column_stack([stiffness(1.0) * (10.0 + 20.0 * slope * (offsets - 0.05)), offsets]) for slope in (1.0, -1.0)
    ]
    about = {"error_bound": np.zeros((11, 2)), "special": (), "line": True}
    pitchfork = MapCurve(kind=Kind.PITCHFORK, values=lines[0], coefficient=0.05 - offsets, **about)
    about["error_bound"] = np.zeros((6, 2))
    fold = MapCurve(kind=Kind.FOLD, values=lines[1][:6], coefficient=np.full(6, np.nan), **about)
    x, y = np.meshgrid(found.x_values / stiffness(1.0), found.y_values)
    straight = x > 10.0 + 20.0 * (y - 0.05)
    assert found.as_json()["folded_share"] is None  # folds were not followed
    assert np.isnan(found.to_dataset().folded).all()
    both = replace(found, fate=(~straight).astype(np.int8), curves=(pitchfork, fold), folds_known=True)
    np.testing.assert_array_equal(both.folded, straight & (y < 0.05) & (x < 10.0 - 20.0 * (y - 0.05)))
    assert both.folded.any()
    assert both.as_json()["folded_share"] == both.to_dataset().folded.values.mean() > 0.0
    assert any("beside curved walks" in line for line in both.lines())
    assert "curved walks too" in [text.get_text() for text in both.plot(Figure().add_subplot()).get_legend().texts]
    assert not replace(both, curves=(pitchfork,)).folded.any()
    some = replace(both, folds_known=False)
    np.testing.assert_array_equal(some.folded, np.where(both.folded, 1.0, np.nan))
    assert (some.as_json()["folded_share"], "beside curved walks" in str(some)) == (None, False)
    assert "curved walks too" in [text.get_text() for text in some.plot(Figure().add_subplot()).get_legend().texts]


def test_curved_walks_in_a_corner_between_curves_that_leave_by_other_edges():
    """No row and no column of the corner has both the pitchfork and the fold."""
    found = mapped(ROBOT, (K1, "11 N*mm/deg", "12 N*mm/deg"), (OFFSET[0], "31 mm", "32 mm"), points=9, also=["folds"])
    assert (found.as_json()["folded_share"], found.curves) == (None, ())
    (remark,) = found.remarks
    assert remark == "beside 81 stable straight walks curved ones are not known: their pitchfork is not on the map"
    low, wide = np.array([stiffness(11.0), 0.031]), np.array([stiffness(1.0), 0.001])
    about = {"error_bound": np.zeros((2, 2)), "special": (), "line": True}
    fork, fold = ([[0.0, 0.6], [0.4, 1.0]], [[0.6, 0.0], [1.0, 0.4]])
    pitchfork = MapCurve(kind=Kind.PITCHFORK, values=low + wide * fork, coefficient=np.ones(2), **about)
    curves = pitchfork, MapCurve(kind=Kind.FOLD, values=low + wide * fold, coefficient=np.full(2, np.nan), **about)
    u, v = np.meshgrid((found.x_values - low[0]) / wide[0], (found.y_values - low[1]) / wide[1])
    fate = (v > u + 0.6).astype(np.int8)
    np.testing.assert_array_equal(replace(found, fate=fate, curves=curves).folded, (abs(u - v) < 0.6))
    for k in (0, 1):  # mirrored, so that the fold is above or on the left
        mirrored = [
            replace(each, values=np.where(np.arange(2) == k, 2.0 * low + wide - each.values, each.values))
            for each in curves
        ]
        turned = replace(found, fate=np.flip(fate, 1 - k), curves=tuple(mirrored)).folded
        np.testing.assert_array_equal(turned, np.flip(abs(u - v) < 0.6, 1 - k))
    # Beyond a supercritical pitchfork there are none.
    gentle = replace(pitchfork, coefficient=-np.ones(2))
    assert not replace(found, fate=fate, curves=(gentle,)).folded.any()


def test_coefficients_of_a_map_are_those_of_its_robots():
    found = mapped(ROBOT, (K1, "11 N*mm/deg", "13 N*mm/deg"), ("body.mass", "8.5 kg", "9 kg"), points=5)
    (curve,) = found.curves
    end = int(np.argmin(curve.values[:, 1]))
    (there,) = bifurcations(ROBOT, K1, (stiffness(11.0), stiffness(13.0)))
    assert curve.coefficient[end] == pytest.approx(there.coefficient, rel=1e-6)


def test_transcritical_curves_have_no_criticality(monkeypatch):
    """The sign of the quadratic term is that of the mode, which is arbitrary: of mirrored robots it differs."""
    monkeypatch.setattr(map_curves, "_LONGEST", 0.5)
    robot = ROBOT.with_value("gait.side_phase", np.deg2rad(210.0))
    found = mapped(robot, (K1, stiffness(10.0), stiffness(11.5)), ("body.mass", 8.0, 9.0), points=2, also=["folds"])
    (curve,) = found.curves
    assert curve.kind is Kind.TRANSCRITICAL
    assert np.isnan(curve.coefficient).all()
    assert set(found.as_json()["curves"][0]["coefficients"]) == {None}
    for show in ("kind", "criticality"):
        lines = found.plot(Figure().add_subplot(), show).lines
        (line,) = (each for each in lines if each.get_label() == "transcritical")
        assert line.get_linestyle() == "-."
    assert found.remarks == ("curved walks beside transcritical points are not followed to their folds",)
    assert found.as_json()["folded_share"] is None


@pytest.mark.parametrize("part", [1e-5, 1e-7])
def test_a_curve_of_a_tiny_map_is_one(part, monkeypatch):
    """Its steps are parts of the map, not of the numbers."""
    monkeypatch.setattr(map_curves, "_LONGEST", 0.2)
    (onset,) = bifurcations(ROBOT, K1, (stiffness(11.0), stiffness(13.0)), normal_form=False)
    k1, offset = onset.point.value, ROBOT.get(OFFSET[0])
    axes = (K1, k1 * (1.0 - part), k1 * (1.0 + part)), (OFFSET[0], offset * (1.0 - 9.0 * part), offset * (1.0 + part))
    found = mapped(ROBOT, *axes, points=5)
    (curve,) = found.curves
    assert found.remarks == ()
    assert curve.kind is Kind.PITCHFORK
    for values, low, high in zip(curve.values[[0, -1]].T, *np.array([axis[1:] for axis in axes]).T, strict=True):
        assert ((low <= values) & (values <= high)).all()
    for values, error in zip(curve.values, curve.error_bound, strict=True):
        line = ROBOT.with_value(OFFSET[0], values[1])
        near = bifurcations(line, K1, (0.999 * k1, 1.001 * k1), normal_form=False)[0].point
        assert abs(near.value - values[0]) <= 10.0 * error.max() * k1 / offset + near.error_bound


def test_messages_of_the_search_do_not_reach_the_user(monkeypatch):
    def lost(*given, **how):
        raise AnalysisError("the curve was not found", field="start", allowed="a point located at `second`")

    monkeypatch.setattr(map_curves, "follow2", lost)
    found = mapped(ROBOT, (K1, "11 N*mm/deg", "13 N*mm/deg"), ("body.mass", "8.5 kg", "9 kg"), points=2)
    assert set(found.remarks) == {
        "a curve that begins at a pitchfork is not followed to its end: the curve was not found"
    }


def test_pitchfork_turns_along_its_curve():
    """Where the coefficients of points located one by one pass through zero."""
    offset = "legs.forward_offset"
    turned = mapped(ROBOT, (K1, stiffness(11.5), stiffness(12.5)), (offset, 0.045, 0.05), points=3)
    (point,) = turned.special
    assert point.kind is CodimensionTwo.DEGENERATE_PITCHFORK
    offsets = point.values[1] + np.array([-1e-4, 1e-4])
    beside = [
        bifurcations(ROBOT.with_value(offset, value), K1, (stiffness(11.8), stiffness(12.1)))[0] for value in offsets
    ]
    low, high = (each.point.coefficient for each in beside)
    assert low > 0.0 > high
    assert point.values[1] == pytest.approx(offsets[0] + 2e-4 * low / (low - high), abs=1e-7)
    assert point.error_bound[1] < 1e-8
    np.testing.assert_allclose(point.values[0], np.mean([each.point.value for each in beside]), rtol=1e-6)


def test_modules_are_whole_and_each_has_its_points():
    found = mapped(ROBOT, ("modules", 5, 7), (K1, "10 N*mm/deg", "16 N*mm/deg"), points=9)
    assert found.x_values.tolist() == [5.0, 6.0, 7.0]
    (curve,) = found.curves
    assert not curve.line
    for (modules, k1), error in zip(curve.values, curve.error_bound, strict=True):
        robot = ROBOT.with_value("body.modules", modules)
        for path in ("body.length", "body.mass"):
            robot = robot.with_value(path, ROBOT.get(path) * modules / 6.0)
        (point,) = bifurcations(robot, K1, (stiffness(10.0), stiffness(16.0)), normal_form=False)
        assert abs(point.point.value - k1) <= error[1] + point.point.error_bound


def test_speed_keeps_stride_and_duty_factor():
    plane = Plane.over(ROBOT, ("speed", "0.05 m/s", "0.3 m/s"), (K1, 0.5, 1.0))
    fast = plane.at(0.2, 0.7)
    assert fast.gait.speed == pytest.approx(0.2)
    assert (fast.gait.stride, fast.gait.duty) == (ROBOT.gait.stride, pytest.approx(ROBOT.gait.duty))
    assert fast.get(K1) == 0.7


def test_robots_that_cannot_be_are_a_fate_of_their_own():
    found = mapped(ROBOT, (K1, "-10 N*mm/deg", "8 N*mm/deg"), ("ground.friction", 200.0, 300.0), points=4)
    invalid = FATES.index(Fate.INVALID)
    assert ((found.x_values <= 0.0) == (found.fate == invalid)).all()
    assert {FATES[index] for index in found.fate.ravel()} == {Fate.INVALID, Fate.BENDS}
    assert np.isnan(found.growth[:, 0]).all()
    (remark,) = found.remarks
    assert "there is no robot: springs.stiffness[0] = '-10 N*mm/deg': must be positive; allowed: more than 0" in remark


def test_every_reason_why_there_is_no_robot_is_said():
    found = mapped(ROBOT, ("modules", 1, 3), ("springs.stiffness[2]", 1.0, 2.0), points=2)
    (remark,) = found.remarks
    assert remark.startswith("at 6 of the values there is no robot: body.modules = 1.0: ")
    assert "; or springs.stiffness[2]: must be the index of a spring" in remark


def test_a_speed_that_cannot_be_has_its_unit():
    with pytest.raises(ParameterError, match=r"^speed = '-1 m/s': must be positive; allowed: more than 0 m/s$"):
        Plane.over(ROBOT, ("speed", -1.0, 1.0), OFFSET).at(-1.0, 0.0)


def test_a_file_for_growth_rates_that_cannot_be_written_is_refused_at_once(tmp_path, monkeypatch):
    monkeypatch.setattr(map_grid, "growth_rates", None)
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="file: must be a folder, and is a file"):
        mapped(ROBOT, X, OFFSET, points=5, kept=tmp_path / "file" / "rates.nc")


def test_a_map_that_was_cut_off_goes_on(tmp_path, monkeypatch):
    axes, file = ((K1, 0.9, 2.0), (OFFSET[0], 0.02, 0.06)), tmp_path / "rates.nc"
    counts, compute = [], map_grid.growth_rates

    def counted(robots, count, progress):
        counts.append(count)
        if len(counts) == 2:
            raise KeyboardInterrupt
        return compute(robots, count, progress)

    monkeypatch.setattr(map_grid, "growth_rates", counted)
    monkeypatch.setattr(map_grid, "_AT_ONCE", 100)
    with pytest.raises(KeyboardInterrupt):
        mapped(ROBOT, *axes, points=13, kept=file)
    whole = mapped(ROBOT, *axes, points=13, kept=file)
    assert counts == [100, 69, 69]
    assert (whole.computed.all(), whole.fate.any()) == (True, False)
    mapped(ROBOT, *axes, points=13, kept=file)
    assert len(counts) == 3
    other = (K1, 0.9, 2.1), axes[1]
    for robot, given in ((ROBOT.with_value("body.mass", 8.0), axes), (ROBOT, other)):
        with pytest.raises(OutputError, match="has the growth rates of another map"):
            mapped(robot, *given, points=13, kept=file)
    file.write_bytes(file.read_bytes()[:-9])
    with pytest.raises(OutputError, match="is damaged or was edited"):
        mapped(ROBOT, *axes, points=13, kept=file)
    assert len(counts) == 3
    mapped(ROBOT.with_value("body.mass", 8.0), *axes, points=13, kept=file, replace=True)
    assert counts[3:] == [100, 69]


@pytest.mark.parametrize(
    ("x", "y", "said"),
    [
        (
            X,
            (K1, "1 N*mm/deg", "2 N*mm/deg"),
            "y springs.stiffness[0] = 'springs.stiffness[0]': must not change a number",
        ),
        (X, ("springs.stiffness", 1.0, 2.0), "must not change a number that x changes: springs.stiffness[0]"),
        (("speed", 0.1, 0.2), ("gait.swing", 0.1, 0.2), "must not change a number that x changes: gait.swing"),
        ((K1, "9 N*mm/deg", "2 N*mm/deg"), OFFSET, "must rise from a lower to a higher value"),
        ((K1, "9 N*mm/deg", "9 N*mm/deg"), OFFSET, "must rise from a lower to a higher value"),
        ((K1, 0.1, float("nan")), OFFSET, "must rise"),
        ((K1, "9 mm", "20 mm"), OFFSET, "x springs.stiffness[0] = '9 mm': is a length"),
        (("modules", 4, 7.5), OFFSET, "x modules = '4 7.5': must be whole numbers of modules"),
        (("body.modules", "4.2", "7"), OFFSET, "must be whole numbers of modules"),
        (("module", 4, 7), OFFSET, "did you mean 'modules'?"),
        (("gait.strid", 0.1, 0.2), OFFSET, "did you mean 'gait.stride'?"),
        (("springs.stiffness[5:]", 0.1, 0.2), OFFSET, "must be a group of springs"),
        (("springs.rate", 0.1, 0.2), OFFSET, "must be a number that the planar model reads"),
    ],
)
def test_bad_axes(x, y, said):
    with pytest.raises(ChilopodError) as caught:
        mapped(ROBOT, x, y, points=5)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_few_points_and_a_long_map_are_said(monkeypatch):
    with pytest.raises(ChilopodError, match="points"):
        mapped(ROBOT, X, OFFSET, points=1)
    said = []
    monkeypatch.setattr(sys.modules[mapped.__module__], "_LONG", 1e-3)
    mapped(ROBOT, (K1, 1.9, 2.0), ("legs.half_width", 0.07, 0.08), points=2, remark=said.append)
    assert "the map takes about" in said[0]


def test_a_map_of_hours_is_refused_unless_growth_rates_are_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[mapped.__module__], "_LONG", 1e-3)
    monkeypatch.setattr(sys.modules[mapped.__module__], "_LONGEST", 1e-6)
    axes = (K1, 1.9, 2.0), ("legs.half_width", 0.07, 0.08)
    with pytest.raises(ParameterError, match=r"^points = 2: the map would take about .*; allowed: "):
        mapped(ROBOT, *axes, points=2)
    assert mapped(ROBOT, *axes, points=2, kept=tmp_path / "rates.nc").growth.shape == (2, 2)
