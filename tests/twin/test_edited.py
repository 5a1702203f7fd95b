from functools import partial

import numpy as np
import pytest

from chilopod import load_robot, twin
from chilopod.engine.check import check_engine
from chilopod.errors import ParameterError
from chilopod.trials import NONE, Trial, run

PRESET = load_robot("aoi2022")


def nothing(spec, robot):
    pass


def rolls(spec, robot):
    for i in range(2, robot.body.modules + 1):
        spec.body(f"module{i}").add_joint(name=f"roll{i}", axis=[1, 0, 0], stiffness=[400.0, 0, 0], damping=[2.0, 0, 0])


SAME, ROLLS = twin.Edited("same", nothing), twin.Edited("rolls", rolls)


def bend(engine):
    trial = Trial(PRESET, 3.0, 0, (0.3, 0.2, 0.2, 0.2, 0.1), disturbance=NONE, rate=10.0, engine=engine)
    return next(iter(run([trial]))).joint_angle.values


def test_an_edit_that_changes_nothing_changes_nothing():
    np.testing.assert_array_equal(bend(f"{__name__}:SAME"), bend("twin"))


def test_an_edit_changes_the_walk():
    ours, theirs = bend(f"{__name__}:ROLLS"), bend("twin")
    assert ours.shape == theirs.shape
    assert np.isfinite(ours).all()
    assert np.abs(ours - theirs).max() > 1e-4


@pytest.mark.slow
def test_an_edited_twin_keeps_the_promises_of_an_engine():
    check_engine(ROLLS, PRESET)


def test_trials_of_one_edit_are_not_those_of_another():
    def versions(*edits):
        return [twin.Edited("own", each).traits.version for each in edits]

    one, same, other, none = versions(
        lambda spec, robot: setattr(spec.option, "timestep", 1e-3),
        lambda spec, robot: setattr(spec.option, "timestep", 1e-3),
        lambda spec, robot: setattr(spec.option, "timestep", 2e-3),
        nothing,
    )
    assert one == same
    assert len({one, other, none, twin.traits.version}) == 4


SOFT, TABLE = 50.0, [50.0]


def soft(spec, robot, more=0.0):
    spec.body("module2").add_joint(name="roll2", axis=[1, 0, 0], stiffness=[SOFT + TABLE[0] + more, 0, 0])


def closed(more):
    return lambda spec, robot: soft(spec, robot, more)


class Called:
    def __init__(self, more):
        self.more = more

    def __call__(self, spec, robot):
        soft(spec, robot, self.more)


GLOBAL = twin.Edited("soft", soft)
MADE = {"closure": closed, "partial": lambda more: partial(soft, more=more), "called": Called}


def test_the_numbers_that_an_edit_uses_are_part_of_a_trial_and_walked_as_they_are_now(monkeypatch):
    found = []
    for change in (lambda: 0, lambda: monkeypatch.setattr(f"{__name__}.SOFT", 5.0), lambda: TABLE.__setitem__(0, 7.0)):
        change()
        model = GLOBAL.start(PRESET)._plan.model
        found.append((Trial(PRESET, 1.0, engine=f"{__name__}:GLOBAL").file_name, model.joint("roll2").stiffness[0]))
    TABLE[0] = 50.0
    assert [stiffness for _, stiffness in found] == [100.0, 55.0, 12.0]
    assert len({name for name, _ in found}) == 3


@pytest.mark.parametrize("how", MADE)
def test_an_edit_is_anything_that_is_called_and_told_apart_by_what_it_holds(how, monkeypatch):
    names = []
    for more in (1.0, 2.0, 1.0):
        monkeypatch.setattr(f"{__name__}.GLOBAL", twin.Edited("soft", MADE[how](more)))
        names.append(Trial(PRESET, 1.0, engine=f"{__name__}:GLOBAL").file_name)
    assert names[0] == names[2] != names[1]
    assert GLOBAL.start(PRESET)._plan.model.joint("roll2").stiffness[0] == 101.0


@pytest.mark.parametrize("edit", [3, print])
def test_what_has_no_code_is_no_edit(edit):
    with pytest.raises(ParameterError, match=r"edit = .*must be a function in Python"):
        twin.Edited("none", edit)
