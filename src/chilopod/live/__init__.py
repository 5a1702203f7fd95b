"""The live page: a robot that walks in the browser, and everything that can be done to it while it does.

``wishes`` are what somebody wants, ``session`` owns the walk and does it, ``state`` is what there is to see of it,
``theory`` computes beside it where the walk gives way, ``words`` says what is seen, ``body`` is where the robot's parts
are; nothing of that knows of a browser. ``server`` shows it in one with viser, ``gate`` lets in nobody but the page,
``controls``, ``scene`` and ``plots`` are parts of it.
"""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.live.server import Live
    from chilopod.live.session import Session
    from chilopod.live.state import Seen, Settings
else:
    __getattr__, __dir__ = exports(
        __name__, {"server": ("Live",), "session": ("Session",), "state": ("Seen", "Settings")}
    )

__all__ = ["Live", "Seen", "Session", "Settings"]
