"""``chilopod walk``, ``turn`` and ``course``: let a robot walk, to a target, or from target to target."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from chilopod.cli.options import OutOption, choices, free, quantity, with_options
from chilopod.cli.walking import WalkOptions
from chilopod.errors import concerning

if TYPE_CHECKING:
    from chilopod.progress import Progress
    from chilopod.record_file import RecordFile
    from chilopod.tasks import Driven, Turn
    from chilopod.trials import Trial

_MUCH = 1e9  # bytes


def _courses() -> list[str]:
    from chilopod.steering import COURSES

    return [*COURSES, "random:"]


TargetsOption = Annotated[
    str,
    typer.Option(
        metavar="TARGETS|FILE|slalom|square|eight|random:SEED",
        help='Targets one after another, such as "45 deg, 1.3 m; -60 deg, 1.5 m", each seen from where the robot '
        'is by then, or "1 m, 0.5 m; 2 m, 0 m", places on the floor; a file with one target a line; a course by '
        "name; or five random targets.",
        autocompletion=_courses,
    ),
]
StrategyOption = Annotated[
    str,
    typer.Option(help="Strategy of turning, with leg yaw of module 1.", autocompletion=lambda: choices("ON_COURSES")),
]


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
    described, seconds = options.described, quantity("duration", duration, "s")
    with concerning("initial_joints"):
        angles = joint_angles(initial_joints)
    samples = quantity("rate", rate, "Hz")
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


@with_options
def course(
    options: WalkOptions,
    targets: TargetsOption,
    strategy: StrategyOption = "variable",
    k1: Annotated[
        str | None,
        typer.Option(
            "--k1",
            metavar="VALUE",
            help='Stiffness of the springs that pitchfork and hopf walk with, such as "15 N*mm/deg"; only for these.',
        ),
    ] = None,
    patience: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            help='Time for each target, such as "60 s", before the next has its turn; by default 40 s (planar) or 70 s '
            "(twin).",
        ),
    ] = None,
    out: OutOption = None,
) -> None:
    """Let a robot walk from target to target, and report the outcome of each.

    A target is reached where the robot comes within 0.15 m of it; then, or when its time is over, the next has its
    turn. The robot sees the target as a laser scanner on module 1 does: within 4.1 m and 120 deg to either side.

    With --out, draws the way and writes the record, a replay that opens in any browser, and a film.

    Example: chilopod course aoi2022-planar --targets "45 deg, 1.3 m; -60 deg, 1.5 m" --out course
    """
    from chilopod.steering import ON_COURSES, course_named, strategy_named

    described = options.described
    chosen = strategy_named(strategy, ON_COURSES)
    spring = None if k1 is None else options.spring(chosen.springs, k1)
    chosen.check(spring)
    seconds = None if patience is None else quantity("patience", patience, "s")
    goals = course_named(targets, 1.0 if seconds is None else seconds)  # the engine's own patience takes long to load

    def results(progress: Callable[[str], Progress]) -> Driven:
        how = options.steering  # before what takes seconds to import
        from chilopod.tasks.course import Driver, drive, driver, patience_of
        from chilopod.trials import check_fits

        way = replace(goals, patience=patience_of(options.engine)) if seconds is None else goals
        # What cannot be driven is refused before the radius law takes its time.
        check_fits(Driver(described, chosen, law=None, **how).trial(way).repeated(options.seed, options.repeats))
        ready = driver(described, chosen, spring, **how, folder=options.trials, progress=progress("radius law"))
        return drive(ready, way, **options.runs(progress("course")))

    options.walk_into(out, "course", results)


@with_options
def turn(
    options: WalkOptions,
    target: Annotated[
        str,
        typer.Option(
            metavar="BEARING, DISTANCE", help='Target, such as "45 deg, 1.3 m"; a positive bearing is to the left.'
        ),
    ],
    k1: Annotated[
        str,
        typer.Option(
            "--k1",
            metavar="auto|law|VALUE",
            help="Stiffness of the springs that the strategy softens. auto: nearest to the target in undisturbed "
            "trials; law: the settled walk is the circle to the target (the paper's k1-hat), as is auto for open-loop; "
            'or a value such as "10 N*mm/deg".',
        ),
    ] = "auto",
    strategy: Annotated[
        str, typer.Option(help="Strategy of turning.", autocompletion=lambda: choices("STRATEGIES"))
    ] = "pitchfork",
    duration: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            help='Time to walk, such as "30 s"; by default 1.6 (planar) or 2.8 (twin) times what the circle to the '
            "target takes at the speed of the straight walk, 5 s at least.",
        ),
    ] = None,
    out: OutOption = None,
) -> None:
    """Pick the spring that leads to a target, walk there, and report the outcome.

    The robot arrives where it comes within 0.15 m of the target. The criteria are the paper's. Epsilon 1 is the
    distance to the target and epsilon 2 the angle between heading and target when the first walk arrives. Epsilon 3 is
    the cost of steering until then, the integral of the squared leg yaw.

    With --out, draws the way and writes the record, and a replay that opens in any browser.

    Example: chilopod turn aoi2022-planar --target "45 deg, 1.3 m" --out turn
    """
    from chilopod.steering import Target, strategy_named

    described = options.described
    goal, chosen = Target.parse(target), strategy_named(strategy)
    spring = k1 if k1 in ("auto", "law") else options.spring(chosen.springs, k1, "auto", "law")
    seconds = None if duration is None else quantity("duration", duration, "s")

    def results(progress: Callable[[str], Progress]) -> Turn:
        how = {"duration": seconds, **options.steering}
        from chilopod.tasks import turn as walk_there

        return walk_there(described, goal, chosen, spring, **how, **options.runs(progress("turn")))

    options.walk_into(out, "turn", results)
