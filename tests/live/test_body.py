"""Where the parts of a robot are drawn."""

import numpy as np
import pytest

from chilopod.kinematics import module_centres, module_headings
from chilopod.live import Session, wishes
from chilopod.live.body import KINDS, flat_places
from chilopod.live.body_3d import SolidBody
from chilopod.robot import load_robot
from chilopod.show.scene.frames import body_frames
from chilopod.trials import NONE, Trial, run

PLANAR, TWIN = load_robot("aoi2022-planar"), load_robot("aoi2022")


def turned(quaternion, vector):
    w, x, y, z = quaternion
    axis = np.array([x, y, z])
    return vector + 2.0 * np.cross(axis, np.cross(axis, vector) + w * vector)


@pytest.mark.parametrize("time", [0.0, 0.23, 0.6, 1.37])
def test_the_flat_body_is_that_of_replays(time):
    """Whose feet are placed from a record."""
    (record,) = run([Trial(PLANAR, 2.0, joint_angles=(0.1, 0.2, -0.1, 0.0, 0.1), disturbance=NONE)])
    frames = body_frames(record, [time])
    walking = Session(PLANAR)
    seen = walking.seen()
    at = record.interp(time=time).isel(robot=0)
    seen = type(seen)(
        **{
            **vars(seen),
            "clock": time,
            "pose": np.array([*at.position.values, float(at.heading)]),
            "joint_angles": at.joint_angle.values,
            "leg_yaw": at.leg_yaw.values,
        }
    )
    placed = flat_places(seen)
    np.testing.assert_allclose(placed["box"].centres[:, :2], frames.centres[0, 0], atol=1e-6)
    np.testing.assert_allclose(placed["ball"].centres[:, :2], frames.feet[0, 0].reshape(-1, 2), atol=1e-6)
    np.testing.assert_allclose(placed["pin"].centres[:, :2], frames.spine[0, 0, 1:-1], atol=1e-6)
    down = placed["ball"].centres[:, 2] <= placed["ball"].centres[:, 2].min() + 1e-9
    np.testing.assert_array_equal(down, frames.stands[0, 0].ravel())
    rods = placed["rod"]
    ends = [
        centre - 0.5 * turned(turn, np.array([0.0, 0.0, scale[2]]))
        for centre, turn, scale in zip(rods.centres, rods.turns, rods.scales, strict=True)
    ]
    np.testing.assert_allclose(ends, placed["ball"].centres, atol=1e-9)


def test_the_twin_is_where_its_model_has_it():
    walking = Session(TWIN, "twin")
    walking.box.put(wishes.Pull(0, 0.5))
    walking.obey()
    walking.walk_on(1.1)
    seen = walking.seen()
    placed = SolidBody(TWIN).places(seen)
    assert set(placed) == set(KINDS)
    headings = module_headings(seen.pose[2], seen.joint_angles)
    centres = module_centres(seen.pose[:2], headings, TWIN.module_length)
    np.testing.assert_allclose(placed["box"].centres[:, :2], centres, atol=5e-3)
    assert len(placed["rod"].centres) == 24
    assert len(placed["ball"].centres) == 12
    # At any time some feet stand, sunk in by less than a millimetre, and some are in the air: swinging feet of this
    # robot clear the floor by millimetres.
    heights = placed["ball"].centres[:, 2] - placed["ball"].scales[:, 2]
    assert -1e-3 < heights.min() < 0.0
    assert 2e-3 < heights.max() < 2e-2
