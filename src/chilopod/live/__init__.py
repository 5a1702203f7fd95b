"""The live page: a robot that walks in the browser, and everything that can be done to it while it does.

``wishes`` are what somebody wants, ``session`` owns the walk and does it, ``theory`` computes beside it where the walk
gives way, ``words`` says what is seen, ``body`` is where the robot's parts are; nothing of that knows of a browser.
``page`` shows it in one with viser, ``controls``, ``scene`` and ``plots`` are its parts, ``server`` runs it all.
"""

from typing import TYPE_CHECKING

from chilopod.lazy import exports

if TYPE_CHECKING:
    from chilopod.live.server import Live
    from chilopod.live.session import Seen, Session
else:
    __getattr__, __dir__ = exports(__name__, {"server": ("Live",), "session": ("Seen", "Session")})

__all__ = ["Live", "Seen", "Session"]
