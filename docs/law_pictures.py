"""The pictures of docs/courses.md, docs/atlas.md and of the README: ``python docs/law_pictures.py`` writes them to
``docs/images``.

Each of ``law-*.webp`` shows one idea of the spring law: the path of one robot without the idea and with it, on the same
targets. ``course.webp`` is a course. ``scaling.webp`` and ``atlas.webp`` are figures of the report.
"""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from PIL import Image

from chilopod.output import write_atomic
from chilopod.paper.atlas import maps, scaling
from chilopod.paper.courses.steps import steps
from chilopod.paper.section import Context
from chilopod.progress import silent
from chilopod.robot import load_robot
from chilopod.show import style
from chilopod.show.figures.course import draw
from chilopod.show.scene.frames import body_frames
from chilopod.steering import ARRIVAL_RADIUS, VARIABLE, course_named
from chilopod.tasks import drive, driver

PATIENCE = 40.0  # s
IDEAS = {
    "bend": ("45 deg, 1.3 m; -50 deg, 1.2 m", 0, "k1-hat of the circle in every cycle", "bends compared"),
    "search": ("130 deg, 1 m", 1, "without search", "with search"),
    "near": ("60 deg, 1.2 m; 60 deg, 0.3 m", 2, "stays on the circle", "leaves the circle"),
    "ahead": ("1.5 m, 0.5 m; 3 m, -0.5 m; 4.5 m, 0.5 m", 3, "one circle to each target", "two modules ahead"),
}
"""By name: the targets, the step before the idea (see :func:`chilopod.paper.courses.steps.steps`), and what the walks
without it and with it are called."""


def picture(targets: str, step: int, titles: tuple[str, str]) -> bytes:
    """Two walks side by side."""
    ready = driver(load_robot("aoi2022-planar"), VARIABLE)
    laws = list(steps(ready.controller).values())[step : step + 2]
    course = course_named(targets, PATIENCE)
    records = [drive(replace(ready, controller=law), course, seed=1).records[0] for law in laws]
    with style.house_style():
        figure, axes = style.figure(style.Layout("AB", 3.6), style.Layout("A;B", 6.0), False)
        for name, record, title in zip("AB", records, titles, strict=True):
            _draw(axes[name], record)
            axes[name].set_title(f"{title}: {_outcome(record)}")
        low = np.min([(*axes[name].get_xlim()[:1], *axes[name].get_ylim()[:1]) for name in "AB"], axis=0)
        high = np.max([(*axes[name].get_xlim()[1:], *axes[name].get_ylim()[1:]) for name in "AB"], axis=0)
        figure.legend(*axes["A"].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        for name in "AB":
            axes[name].set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        return _webp(figure)


def course_picture() -> bytes:
    """A course driven with a spring that is set on the way."""
    ready = driver(load_robot("aoi2022-planar"), VARIABLE)
    done = drive(ready, course_named("slalom", PATIENCE), seed=1)
    with style.house_style():
        return _webp(draw(done))


def _webp(figure: Figure) -> bytes:
    written = io.BytesIO()
    Image.open(io.BytesIO(style.png(figure, 90))).save(written, "WEBP", quality=70, method=6)
    return written.getvalue()


def _outcome(record: xr.Dataset) -> str:
    arrived = (record.goal_verdict.values[0] == "arrived").sum()
    return f"{arrived} of {record.sizes['goal']}, {float(record.goal_end.max()):.0f} s"


def _draw(axes: Axes, record: xr.Dataset) -> None:
    soft = record.stiffness.isel(robot=0, joint=0).values < 1.0
    place = record.position.isel(robot=0).transpose("time", "axis").values
    for which, color, label in ((soft, style.VERMILLION, "soft"), (~soft, style.BLUE, "stiff")):
        axes.plot(*np.where(which[:, None], place, np.nan).T, color=color, linewidth=2.0, label=f"first spring {label}")
    for spine in body_frames(record, record.goal_end.values[0]).spine[:, 0]:
        axes.plot(*spine.T, "-o", color=style.BLACK, alpha=0.45, linewidth=2.5, markersize=3)
    for goal in record.goal_place.values[0]:
        axes.add_patch(Circle((float(goal[0]), float(goal[1])), ARRIVAL_RADIUS, fill=False, ec=style.GREEN, lw=1.6))
    axes.plot(0.0, 0.0, ">", color=style.BLACK, markersize=7)
    axes.set_aspect("equal", adjustable="box")
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.grid(True)


def atlas_pictures() -> dict[str, bytes]:
    """Figures of the atlas by their names."""
    context = Context()
    curves = scaling.collapse(context)
    panels = scaling.panel(curves), maps.panel(maps.atlas(context, silent), curves)
    with style.house_style():
        return {panel.name: _webp(panel.draw(False)) for panel in panels}


if __name__ == "__main__":
    for name, drawn in atlas_pictures().items():
        print(write_atomic(Path(__file__).parent / "images" / f"{name}.webp", drawn, replace=True))
    print(write_atomic(Path(__file__).parent / "images" / "course.webp", course_picture()))
    for name, (targets, step, *titles) in IDEAS.items():
        path = Path(__file__).parent / "images" / f"law-{name}.webp"
        print(write_atomic(path, picture(targets, step, (titles[0], titles[1]))))
