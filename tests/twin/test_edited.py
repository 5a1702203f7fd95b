import numpy as np
import pytest

from chilopod import load_robot, twin
from chilopod.engine.check import check_engine
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
