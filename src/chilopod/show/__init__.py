"""Pictures, films and replays of walks, branches and courses of any robot; computes nothing, knows no paper."""

import logging
from typing import TYPE_CHECKING

from chilopod.lazy import exports

# matplotlib reports a cache folder that it cannot write in three lines, and goes on.
logging.getLogger("matplotlib").setLevel(logging.ERROR)

if TYPE_CHECKING:
    from chilopod.show.files import (
        files_of,
        files_of_map,
        files_of_walks,
        write_branch,
        write_map,
        write_result,
        write_undulation,
        write_walks,
    )
    from chilopod.show.scene.replay import Replay, replay
else:
    __getattr__, __dir__ = exports(
        __name__,
        {
            "files": (
                *("files_of", "files_of_map", "files_of_walks"),
                *("write_branch", "write_map", "write_result", "write_undulation", "write_walks"),
            ),
            "scene.replay": ("Replay", "replay"),
        },
    )

__all__ = [
    "Replay",
    "files_of",
    "files_of_map",
    "files_of_walks",
    "replay",
    "write_branch",
    "write_map",
    "write_result",
    "write_undulation",
    "write_walks",
]
