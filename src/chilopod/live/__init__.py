"""Live page: a robot that walks in the browser and obeys the user.

``wishes`` are the user's requests. ``session`` owns the walk and grants them, ``state`` is the visible state of the
walk, ``theory`` computes the pitchfork and the branch in another process, ``words`` describes the walk, and ``body``
places the robot's parts; none of them uses a browser. ``server`` serves the page with viser, ``gate`` checks every
request, ``controls``, ``scene`` and ``plots`` are the parts of the page, and ``recordings`` are handed out. ``presets``
has robots to choose and settings in the address, ``challenges`` tasks with a check.
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
