"""``chilopod walk``: let a robot walk."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from chilopod.cli.options import free, reading, with_options
from chilopod.cli.walking import WalkOptions

if TYPE_CHECKING:
    from chilopod.record_file import RecordFile
    from chilopod.trials import Trial

_MUCH = 1e9  # bytes


@with_options
def walk(
    options: WalkOptions,
    duration: Annotated[str, typer.Option(metavar="TIME", help='Time to walk, such as "60 s" or "2 min".')] = "60 s",
    initial_joints: Annotated[
        str | None,
        typer.Option(
            metavar="ANGLES",
            help='Joint angles at the start, from the front: "2,0,0,0,0 deg"; one angle is for all joints. By default '
            "the robot starts straight.",
        ),
    ] = None,
    rate: Annotated[str, typer.Option(metavar="RATE", help='Samples per second, such as "10 Hz".')] = "100 Hz",
    forces: Annotated[bool, typer.Option("--forces", help="Record the force on every foot.")] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.nc", help="NetCDF file for everything over time.")
    ] = None,
) -> None:
    """Let a robot walk, once or many times, and say where it gets to.

    It starts at the origin and heads along x; y is to its left. Joint angles are means over the last 5 s, a longer gait
    cycle, or a shorter walk, positive where the body bends to the right; the radius is that of the arc they make of the
    body, as in the paper.

    Example: chilopod walk aoi2022-planar --set "springs.stiffness[0]=8 N*mm/deg" --seed 1 --repeats 4 --out walks.nc
    """
    from chilopod import units

    described = options.described
    with reading("duration"):
        seconds = units.parse(duration, "s")
    with reading("initial_joints"):
        angles = joint_angles(initial_joints)
    with reading("rate"):
        samples = units.parse(rate, "Hz")
    free([out] if out else [], options.force, ".nc")
    with ExitStack() as stack:
        with options.walking("walk") as progress:
            how = options.steering  # before what takes seconds to import
            from chilopod.tasks import ends
            from chilopod.trials import Trial

            one = Trial(described, seconds, 0, angles, rate=samples, forces=forces, **how)
            trials = one.repeated(options.seed, options.repeats)
            file = stack.enter_context(_record_file(out, trials)) if out else None
            add = file.add if file else lambda index, record: None
            done = ends(trials, options.trials, progress("walk"), add)
        hint = '--seed 1, or --initial-joints "2 deg"'
        options.deliver(lambda: file.write(replace=options.force) if file else [], done, hint)


def _record_file(path: Path, walks: Sequence[Trial]) -> RecordFile:
    """For the record of all walks; says what it takes if that is much."""
    from chilopod.memory import in_words
    from chilopod.record_file import RecordFile

    size = sum(walk.least_bytes for walk in walks)
    file = RecordFile(path, len(walks), size)
    if size > _MUCH:
        typer.echo(f"{path} will have {in_words(size)} or more", err=True)
    return file


def joint_angles(text: str | None) -> tuple[float, ...]:
    """Read ``"2,0,0,0,0 deg"``: numbers with one unit behind; rad."""
    from chilopod import units

    if text is None:
        return ()
    numbers = text.split(",")
    last, _, unit = numbers[-1].strip().partition(" ")
    return tuple(units.parse(f"{number.strip()} {unit}".strip(), "rad") for number in [*numbers[:-1], last])
