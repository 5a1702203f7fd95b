"""The twin with changes of one's own."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from types import CodeType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.robot import Robot
from chilopod.twin.model import Edit
from chilopod.twin.start import common, initial_states, resume, start, traits
from chilopod.twin.walk import TwinWalk

Array = NDArray[np.float64]


class Edited:
    """The twin with changes of one's own to its description for MuJoCo: an engine, see :class:`chilopod.engine.Engine`.

    What MuJoCo can describe and a robot file cannot (joints between modules that roll, dry friction in a gear, a floor
    with bumps) is tried in a few lines::

        def rolls(spec, robot):
            for i in range(2, robot.body.modules + 1):
                spec.body(f"module{i}").add_joint(name=f"roll{i}", axis=[1, 0, 0], stiffness=[50, 0, 0])

        give = Edited("give", rolls)  # in module my_robot: chilopod walk --engine my_robot:give

    Parameters
    ----------
    name
        As it is recorded.
    edit
        A function, called with the description (``mujoco.MjSpec``, names as in :class:`TwinModel`) and the robot,
        before the step is taken into account (:mod:`chilopod.twin.step`). Trials are told apart by its code and the
        numbers of its module that it uses, not by functions that it calls.
    """

    def __init__(self, name: str, edit: Edit) -> None:
        version = (
            f"{traits.version}, edit {hashlib.sha256(repr(_content(edit.__code__, edit)).encode()).hexdigest()[:12]}"
        )
        self.traits = replace(traits, name=name, sentence=f"{traits.sentence}, {name}", version=version)
        self._edit = edit

    def common(self, robot: Robot) -> Robot:
        """As of the twin."""
        return common(robot)

    def initial_states(self, *arguments: Any, **named: Any) -> Array:
        """As of the twin."""
        return initial_states(*arguments, **named, edit=self._edit)

    def start(self, *arguments: Any, **named: Any) -> TwinWalk:
        """As of the twin."""
        return start(*arguments, **named, edit=self._edit, traits=self.traits)

    def resume(self, saved: bytes, threads: int = 0) -> TwinWalk:
        """As of the twin."""
        return resume(saved, threads, edit=self._edit, traits=self.traits)


def _content(code: CodeType, edit: Any) -> tuple[Any, ...]:
    """Code of a function, and the plain values of its module that it uses: trials with another edit are others."""
    used = {name: edit.__globals__.get(name) for name in code.co_names}
    plain = {name: value for name, value in used.items() if isinstance(value, int | float | str | tuple)}
    inner = [_content(each, edit) if isinstance(each, CodeType) else repr(each) for each in code.co_consts]
    return code.co_code, code.co_names, inner, plain
