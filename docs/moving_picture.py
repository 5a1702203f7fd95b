"""The moving picture of the README: ``python docs/moving_picture.py`` writes ``docs/images/turning.webp``.

Two walks of the twin towards the paper's target A, alike but for the first spring. It needs OpenGL, as all films in
three dimensions.
"""

from __future__ import annotations

import io
import tempfile
from pathlib import Path

import av

from chilopod.output import write_atomic
from chilopod.robot import load_robot
from chilopod.show.scene.film_3d import Film3D
from chilopod.steering import LegYawController, Target
from chilopod.trials import Trial, run, together

SPRINGS = {"41 N*mm/deg": "k1 = 41: too stiff", "21 N*mm/deg": "k1 = 21: bends"}
SIZE, SPEED, PER_SECOND = (800, 288), 3.0, 10
LAST = 15
"""Pictures for which the end is shown before it begins again."""


def film(path: Path) -> None:
    """Walk, and write the film of it."""
    robot = load_robot("aoi2022")
    asked = [
        Trial(
            robot.override("springs.stiffness[0]", spring),
            24.0,
            seed=1,
            target=Target.parse("45 deg, 1.3 m"),
            controller=LegYawController(),
            rate=25.0,
            engine="twin",
            poses=True,
        )
        for spring in SPRINGS
    ]
    heading = "A softer first spring turns the robot"
    look = {"titles": list(SPRINGS.values()), "heading": heading, "fps": PER_SECOND, "speed": SPEED, "size": SIZE}
    write_atomic(path, Film3D(together(run(asked)), **look).mp4())


def picture(path: Path) -> bytes:
    """The film as an animated picture, which a page on the web shows without being asked to play it."""
    with av.open(str(path)) as video:
        pictures = [frame.to_image() for frame in video.decode(video=0)]
    pause = 1000 // PER_SECOND
    written = io.BytesIO()
    pictures[0].save(
        written,
        "WEBP",
        save_all=True,
        append_images=pictures[1:],
        duration=[pause] * (len(pictures) - 1) + [LAST * pause],
        loop=0,
        quality=60,
        method=6,
    )
    return written.getvalue()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        film(Path(folder) / "turning.mp4")
        kept = write_atomic(Path(__file__).parent / "images" / "turning.webp", picture(Path(folder) / "turning.mp4"))
    print(kept)
