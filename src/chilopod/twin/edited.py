"""The twin with user-defined changes."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import partial
from types import CodeType
from typing import Any

from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.robot import Robot
from chilopod.twin.cycle_map import CycleMap, walk_cycle
from chilopod.twin.model import Edit
from chilopod.twin.start import common, initial_states, resume, start, traits
from chilopod.twin.walk import TwinWalk


class Edited:
    """Twin with user-defined changes to its description for MuJoCo: an engine, see :class:`chilopod.engine.Engine`.

    It adds features of MuJoCo that a robot file lacks (roll joints between modules, dry friction in a gear, a floor
    with bumps) in a few lines::

        def rolls(spec, robot):
            for i in range(2, robot.body.modules + 1):
                spec.body(f"module{i}").add_joint(name=f"roll{i}", axis=[1, 0, 0], stiffness=[50, 0, 0])

        give = Edited("give", rolls)  # in module my_robot: chilopod walk --engine my_robot:give

    It has a name, for records, and a function ``edit``, which is called with the description (``mujoco.MjSpec``, names
    as in :class:`TwinModel`) and the robot, before the corrections for the step (:mod:`chilopod.twin.step`). Everything
    that its code can reach is part of a trial, as for a controller.
    """

    def __init__(self, name: str, edit: Edit) -> None:
        function: Any = getattr(edit, "func", edit)  # of a partial
        function = function if hasattr(function, "__code__") else type(function).__call__
        if not hasattr(function, "__code__"):
            raise ParameterError("must be a function in Python", field="edit", value=edit, allowed="def or lambda")
        content = hashlib.sha256(repr(_content(function.__code__, function)).encode()).hexdigest()[:12]
        version, sentence = f"{traits.version}, edit {content}", f"{traits.sentence}, {name}"
        self.traits = replace(traits, name=name, sentence=sentence, version=version)
        self._edit = edit

    def common(self, robot: Robot) -> Robot:
        """See :func:`chilopod.twin.common`."""
        return common(robot)

    def initial_states(self, *arguments: Any, **named: Any) -> Array:
        """See :func:`chilopod.twin.initial_states`."""
        # Models are shared by their edit, here a new object: what the edit does may have changed since the last.
        return initial_states(*arguments, **named, edit=partial(self._edit))

    def start(self, *arguments: Any, **named: Any) -> TwinWalk:
        """See :func:`chilopod.twin.start`."""
        return start(*arguments, **named, edit=partial(self._edit), traits=self.traits)

    def walk_cycle(self, robot: Robot) -> tuple[CycleMap, Array]:
        """See :func:`chilopod.twin.walk_cycle`."""
        return walk_cycle(robot, partial(self._edit))

    def resume(self, saved: bytes, threads: int = 0) -> TwinWalk:
        """See :func:`chilopod.twin.resume`."""
        return resume(saved, threads, edit=partial(self._edit), traits=self.traits)


def _content(code: CodeType, edit: Any) -> tuple[Any, ...]:
    """Code of a function, and the plain values of its module that it uses, as part of a trial's name."""
    used = {name: edit.__globals__.get(name) for name in code.co_names}
    plain = {name: value for name, value in used.items() if isinstance(value, int | float | str | tuple)}
    inner = [_content(each, edit) if isinstance(each, CodeType) else repr(each) for each in code.co_consts]
    return code.co_code, code.co_names, inner, plain
