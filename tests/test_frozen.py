"""Models and results stay as they are: no array of theirs can be written into, no attribute set."""

import copy
import dataclasses
import pickle
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
import pytest

from chilopod import stability
from chilopod.analysis import bifurcations, straight_walk
from chilopod.flows.taylor import stepping
from chilopod.frozen import ReadOnlyArrays, read_only
from chilopod.planar import PlanarModel, start
from chilopod.planar.along import FollowedModel, walk_means
from chilopod.planar.flow import _advance
from chilopod.planar.stretch import walk_abreast
from chilopod.robot import load_robot
from chilopod.stability.branches.parts import find_fold
from chilopod.stability.orbits.orbit import find_orbit
from chilopod.stability.spectrum import spectrum
from chilopod.steering.criteria import Criteria, Outcome
from chilopod.steering.radius_law import RadiusLaw

PRESET = load_robot("aoi2022-planar")
MODEL = PlanarModel(PRESET)
BETWEEN = (11.5e-3 * 180 / np.pi, 12.5e-3 * 180 / np.pi)


def arrays(thing: object, path: str) -> Iterator[tuple[str, np.ndarray]]:
    """Every array that can be reached from a model or a result."""
    if isinstance(thing, np.ndarray):
        yield path, thing
    elif isinstance(thing, tuple | list):
        for index, each in enumerate(thing):
            yield from arrays(each, f"{path}[{index}]")
    elif dataclasses.is_dataclass(thing):
        names = {field.name for field in dataclasses.fields(thing)}
        for base in type(thing).__mro__:
            names |= {name for name, value in vars(base).items() if isinstance(value, property | cached_property)}
        for name in sorted(names):
            yield from arrays(getattr(thing, name), f"{path}.{name}")


def system(mu: float) -> stability.PeriodicSystem:
    """Orbits x^2 = -mu, which meet in a fold at mu = 0."""
    return stability.from_rhs(lambda t, x: mu + x * x, 1, 1.0)


def pitchfork(mu: float) -> stability.PeriodicSystem:
    return stability.from_rhs(lambda t, x: mu * x - x * x * x, 1, 1.0, orbit=[0.0], spatial_symmetry=[[-1.0]])


def branch() -> stability.Branch:
    (point,) = stability.locate(pitchfork, (-0.3, 0.4))
    return stability.follow(pitchfork, stability.switch(pitchfork, point)[0], (-0.3, 0.4), points=2)


THINGS = {
    "model": lambda: MODEL,
    "followed model": lambda: FollowedModel(PRESET),
    "model of paired legs": lambda: PlanarModel(PRESET.with_value("gait.side_phase", 0.0)),
    "system": lambda: pitchfork(0.1),
    "plain system": lambda: stability.PeriodicSystem(1, 1.0, MODEL.flow, symmetry=[[-1.0]], orbit=[0.0]),
    "multipliers": lambda: stability.multipliers(MODEL),
    "multipliers at a guess": lambda: stability.multipliers(system(-0.1), np.array([-0.3])),
    "sweep": lambda: stability.sweep([MODEL, MODEL]),
    "exponents": lambda: stability.exponents(MODEL),
    "return map": lambda: find_orbit(MODEL).image,
    "spectrum": lambda: spectrum(find_orbit(MODEL).image),
    "located": lambda: stability.locate(pitchfork, (-0.3, 0.4)),
    "fold": lambda: find_fold(system, -0.01, np.array([-0.1]), 1.0),
    "branch": branch,
    "begun": lambda: stability.begin(system, -0.1, [-0.3162]),
    "means": lambda: walk_means([MODEL], MODEL.orbit[None]),
    "straight walk": lambda: straight_walk(PRESET),
    "walk bifurcation": lambda: bifurcations(PRESET, "springs.stiffness[0]", BETWEEN, normal_form=False),
    "radius law": lambda: RadiusLaw(np.array([1.0, 2.0, 3.0]), np.array([0.5, 1.0, np.inf]), "N*m/rad"),
    "criteria": lambda: Criteria(1.0, *(np.zeros(1) for _ in range(5)), (Outcome.ARRIVED,)),
    "schedule": lambda: PRESET.gait.schedule(6),
}


@pytest.mark.parametrize("name", THINGS)
def test_no_array_can_be_written_into(name):
    found = list(arrays(THINGS[name](), name))
    assert found
    for path, array in found:
        assert not array.flags.writeable, path
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
        # Nor through what it is a view of.
        assert array.base is None or not array.base.flags.writeable, path


@pytest.mark.parametrize("model", [MODEL, FollowedModel(PRESET)], ids=["planar", "followed"])
@pytest.mark.parametrize(
    "name", ["robot", "tolerance", "use_symmetry", "period", "stiffness", "damping", "scalars", "orbit", "reflection"]
)
def test_no_attribute_of_a_model_can_be_set(model, name):
    with pytest.raises(AttributeError):
        setattr(model, name, getattr(model, name))


def test_what_was_handed_over_stays_writable_and_apart():
    orbit, mirror = np.zeros(1), np.array([[-1.0]])
    made = stability.PeriodicSystem(1, 1.0, MODEL.flow, spatial_symmetry=mirror, orbit=orbit)
    orbit[0] = mirror[0, 0] = 7.0
    assert (made.orbit, made.spatial_symmetry) == ([0.0], [[-1.0]])


def test_a_flow_may_write_into_the_state_it_is_given():
    def flow(x, t0, t1):
        x *= np.exp(t0 - t1)
        return x, np.exp([[t0 - t1]])

    plain = stability.PeriodicSystem(1, 1.0, flow, orbit=[0.0])
    assert stability.exponents(plain).values == pytest.approx(-1.0)
    assert stability.multipliers(plain, [0.5]).orbit == pytest.approx(0.0, abs=1e-12)


@dataclasses.dataclass(frozen=True)
class Result(ReadOnlyArrays):
    numbers: np.ndarray


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda result: pickle.loads(pickle.dumps(result))])
def test_copies_are_read_only_too(again):
    numbers = again(Result(np.arange(3))).numbers
    assert numbers.tolist() == [0, 1, 2]
    assert not numbers.flags.writeable


def test_read_only_copies_once_and_keeps_the_order_in_memory():
    original = np.asfortranarray(np.arange(6.0).reshape(2, 3))
    frozen = read_only(original)
    assert frozen.flags.f_contiguous
    assert not np.shares_memory(frozen, original)
    assert read_only(frozen) is frozen
    assert read_only(frozen[0]).base is frozen
    view = original[:]
    view.flags.writeable = False
    assert not np.shares_memory(read_only(view), original)


def test_read_only_arrays_compile_no_kernel_a_second_time():
    MODEL.flow_states(MODEL.orbit[None], 0.0, 0.1)
    MODEL.drift(MODEL.orbit)
    MODEL.flow(MODEL.orbit + 1e-3, 0.0, 0.1)
    FollowedModel.flow_each([FollowedModel(PRESET)], MODEL.orbit[None], 0.0, 0.1)
    arrays = [each for signature in _advance.signatures for each in signature if hasattr(each, "layout")]
    assert arrays
    assert all(each.mutable for each in arrays)


def layouts(types: Any) -> Iterator[str]:
    """Layouts of all arrays among the types of some arguments."""
    for each in types:
        if hasattr(each, "layout"):
            yield each.layout
        elif hasattr(each, "types"):
            yield from layouts(each.types)


def test_arrays_of_another_order_in_memory_compile_no_kernel_a_second_time():
    FollowedModel(PRESET).flow(MODEL.orbit + 1e-3, 0.0, 0.1)
    MODEL.flow_states(np.asfortranarray([MODEL.orbit, MODEL.orbit]), 0.0, 0.1)
    start(PRESET, seeds=[3, 4]).advance(0.1)
    system = stability.from_rhs(lambda t, x: [x[1], np.cos(t) - x[0]], 2, 2.0 * np.pi)
    system.flow(np.ones(2), 0.0, 0.1)
    system.flow_states(np.asfortranarray(np.ones((3, 2))), 0.0, 0.1)
    for kernel in (_advance, walk_abreast, stepping.advance):
        assert {layout for signature in kernel.signatures for layout in layouts(signature)} == {"C"}
