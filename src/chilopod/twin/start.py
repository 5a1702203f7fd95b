"""Start of a batch of walks: robots, initial states, floor and targets."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from chilopod.engine import Traits
from chilopod.engine.arguments import as_number, as_robot, as_robots, check_wishes, require, standing
from chilopod.engine.batch import begin, resumed
from chilopod.frozen import Array
from chilopod.record import Recording, in_range
from chilopod.robot import Robot
from chilopod.twin.legs import twin_of
from chilopod.twin.model import Edit, compiled, without_springs
from chilopod.twin.walk import TOLERANCE, TwinWalk, state_size

traits = Traits(
    name="twin",
    sentence="the whole robot in three dimensions",
    noisy=True,
    poses=True,
    robots_per_core=4,
    duration_ratio=2.8,
    version=f"MuJoCo {mujoco.__version__}",
)


def common(robot: Robot) -> Robot:
    """Properties that all robots of a batch share: everything but spring stiffness and damping."""
    twin_of(as_robot(robot))
    return without_springs(robot)


def initial_states(
    robot: Robot,
    joint_angles: ArrayLike = 0.0,
    heading: ArrayLike = 0.0,
    position: ArrayLike = (0.0, 0.0),
    *,
    edit: Edit | None = None,
) -> Array:
    """States of robots with a twin that are about to walk, see :class:`chilopod.engine.Engine`: at rest, feet where the
    gait has them at time 0.

    They are the positions of all joints (MuJoCo's ``qpos``), shape (robots, nq). For ``edit`` see :class:`Edited`.
    """
    plan = compiled(common(robot), edit=edit)
    angles, headings, places = standing(robot, joint_angles, heading, position)
    states = np.tile(plan.initial_positions(), (len(angles), 1))
    states[:, :2] = places
    states[:, 3], states[:, 6] = np.cos(0.5 * headings), np.sin(0.5 * headings)
    states[:, plan.yaw_positions] = angles
    return states


def start(
    robots: Robot | Sequence[Robot],
    *,
    initial: ArrayLike | None = None,
    friction: ArrayLike | None = None,
    target: ArrayLike | None = None,
    seeds: Sequence[int] | None = None,
    record: Recording | None = Recording(),  # noqa: B008  (frozen)
    threads: int = 0,
    tolerance: float = TOLERANCE,
    expected: float = 0.0,
    edit: Edit | None = None,
    traits: Traits = traits,
) -> TwinWalk:
    """Start walks on the floor, see :class:`chilopod.engine.Engine`, of robots that may differ only in the numbers of
    their springs.

    Parameters
    ----------
    initial
        From :func:`initial_states`, shape (walks, nq) or (nq,), or from ``states`` of a walk, (walks, nq + nv).
    target
        Position of a pole on the floor, m, shape (2,) or (walks, 2); observations come from the scanner's last scan.
    seeds
        Seeds of the scanner's noise, one for each walk.
    threads
        Largest number of threads; 0 for all cores. Results are the same to the bit for any number.
    tolerance
        Relative tolerance of MuJoCo's solver of contact forces.
    edit, traits
        See :class:`Edited`.
    """
    tolerance, expected = in_range("tolerance", tolerance, 1.0), check_wishes(record, expected)
    count = as_number("threads", threads) in range(1 << 16)
    require(count, "must be a thread count", "threads", threads, "0 (all cores) or more")
    allowed = "a function or None; a chilopod.engine.Traits"
    fits = callable(edit or common) and isinstance(traits, Traits)  # type: ignore[redundant-expr]
    require(fits, "must be a function and the traits of an engine", "edit, traits", allowed=allowed)
    given = as_robots(robots)
    first = common(given[0])
    require(all(common(each) == first for each in given[1:]), "must be equal except for their springs", "robots")
    size, standing_still = state_size(compiled(first, edit=edit), initial), initial_states(given[0], edit=edit)
    begun = begin(given, standing_still, size, initial, friction, target, seeds)
    return TwinWalk(begun, record, tolerance, expected, traits=traits, threads=int(threads), edit=edit)


def resume(saved: bytes, threads: int = 0, *, edit: Edit | None = None, traits: Traits = traits) -> TwinWalk:
    """Continue a saved walk, see :class:`chilopod.engine.Engine`; the number of threads does not matter."""
    return resumed(traits, saved, partial(TwinWalk, traits=traits, threads=threads, edit=edit))
