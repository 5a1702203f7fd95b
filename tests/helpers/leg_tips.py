"""Where the foot of a leg is, by its angles."""

import numpy as np


def tip_place(twin, angles):
    """Forward kinematics: the foot's centre ahead of and below the hip, m, for hip and knee angles, shape (..., 2)."""
    hip, knee = np.moveaxis(np.asarray(angles, dtype=np.float64), -1, 0)
    return np.stack(
        [
            twin.upper_link * np.sin(hip) + twin.lower_link * np.sin(hip + knee),
            twin.upper_link * np.cos(hip) + twin.lower_link * np.cos(hip + knee),
        ],
        axis=-1,
    )
