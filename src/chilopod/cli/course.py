"""``chilopod course``: let a robot walk from target to target."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from chilopod.cli.options import OutOption, WalkOptions, print_table, reading, with_options

if TYPE_CHECKING:
    from chilopod.progress import Progress
    from chilopod.tasks import Driven


def _courses() -> list[str]:
    from chilopod.steering import COURSES

    return [*COURSES, "random:"]


def _strategies() -> list[str]:
    from chilopod.steering import ON_COURSES

    return list(ON_COURSES)


@with_options
def course(
    options: WalkOptions,
    targets: Annotated[
        str,
        typer.Option(
            metavar="TARGETS|FILE|slalom|square|eight|random:SEED",
            help='Where to, one after another, such as "45 deg, 1.3 m; -60 deg, 1.5 m", each seen from where the robot '
            'is by then, or "1 m, 0.5 m; 2 m, 0 m", places on the floor; a file with one a line; a course by name; or '
            "five at random.",
            autocompletion=_courses,
        ),
    ],
    strategy: Annotated[
        str,
        typer.Option(
            metavar="variable|pitchfork|hopf|leg-yaw|actuated",
            help="How it turns. variable: the first spring is set anew in every gait cycle; pitchfork: a soft first "
            "spring, the same on all the way; hopf: all springs alike and soft; leg-yaw: the springs as they are; "
            "actuated: torques at all joints. The legs of module 1 yaw towards the target in all of them.",
            autocompletion=_strategies,
        ),
    ] = "variable",
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
            help='How long for each target, such as "60 s", before the next has its turn; by default 40 s (planar) or '
            "70 s (twin).",
        ),
    ] = None,
    out: OutOption = None,
) -> None:
    """Let a robot walk from target to target, and say what became of each.

    A target is reached where the robot comes within 0.15 m of it; then, or when its time is over, the next has its
    turn. The robot knows of it what a laser scanner on module 1 sees: within 4.1 m and 120 deg to either side.

    With --out, draws the way and writes the record, a replay that opens in any browser, and a film.

    For example: chilopod course aoi2022-planar --targets "45 deg, 1.3 m; -60 deg, 1.5 m" --out course
    """
    from chilopod import units
    from chilopod.steering import ON_COURSES, course_named, strategy_named

    described = options.described
    chosen = strategy_named(strategy, ON_COURSES)
    spring = None if k1 is None else options.spring(chosen.springs, k1)
    with reading("patience"):
        seconds = None if patience is None else units.parse(patience, "s")

    def walked(told: Callable[[str], Progress]) -> Driven:
        from chilopod.tasks.course import Driver, drive, driver, patience_of
        from chilopod.trials import check_fits

        goals = course_named(targets, patience_of(options.engine) if seconds is None else seconds)
        how = options.steering
        # What cannot be driven is refused before the radius law takes its time.
        check_fits(Driver(described, chosen, law=None, **how).trial(goals).repeated(options.seed, options.repeats))
        ready = driver(described, chosen, spring, **how, folder=options.trials, progress=told("radius law"))
        return drive(ready, goals, **options.runs(told("course")))

    options.walk_into(out, "course", walked, _print)


def _print(done: Driven) -> None:
    told = done.as_json()
    walks, goals = told["walks"], len(done.course.goals)
    typer.echo(f"{done.who}, {done.strategy.name}: {done.strategy.sentence}")
    typer.echo(f"  {goals} target{'s' * (goals > 1)}, {done.course.patience:g} s for each")
    for remark in done.driver.remarks:
        typer.echo(f"  {remark}")
    if len(walks) == 1:
        print_table(_of_targets(walks[0]["targets"]), "  ")
    else:
        print_table(_of_walks(walks, goals), "  ")
    missed = {each["verdict"]: each["sentence"] for walk in walks for each in walk["targets"]}
    missed.pop("arrived", None)
    for verdict, sentence in missed.items():
        typer.echo(f"  {verdict}: {sentence}")
    if len(walks) == 1:
        (walk,) = walks
        typer.echo(
            f"  {walk['arrived']} of {goals} targets in {walk['time_s']:.1f} s; work {walk['spring_work_J']:.3g} J on "
            f"springs, {walk['drive_work_J']:.3g} J by drives; steering's part of the cost of transport "
            f"{_shown(walk['steering_cost_of_transport'], '.2g')}"
        )
    else:
        whole = sum(walk["arrived"] == goals for walk in walks)
        typer.echo(
            f"  {sum(walk['arrived'] for walk in walks)} of {len(walks) * goals} targets, {whole} of {len(walks)} "
            "courses whole"
        )


def _of_targets(goals: list[dict[str, Any]]) -> Iterable[tuple[str, ...]]:
    yield "target", "verdict", "time (s)", "path / shortest", "leg yaw (rad2 s)", "springs (J)", "drives (J)"
    for number, goal in enumerate(goals, 1):
        if not goal["path_m"]:  # it had no turn
            yield str(number), goal["verdict"], *"-----"
            continue
        yield (
            str(number),
            goal["verdict"],
            f"{goal['end_s'] - goal['begin_s']:.1f}",
            f"{goal['path_m']:.2f} / {goal['shortest_m']:.2f} m",
            f"{goal['leg_yaw_effort_rad2_s']:.4f}",
            f"{goal['spring_work_J']:.3f}",
            f"{goal['drive_work_J']:.3f}",
        )


def _of_walks(walks: list[dict[str, Any]], goals: int) -> Iterable[tuple[str, ...]]:
    yield "seed", "targets", "time (s)", "springs (J)", "drives (J)", "cost of transport", "status"
    for walk in walks:
        yield (
            str(walk["seed"]),
            f"{walk['arrived']} of {goals}",
            f"{walk['time_s']:.1f}",
            f"{walk['spring_work_J']:.3f}",
            f"{walk['drive_work_J']:.3f}",
            _shown(walk["steering_cost_of_transport"], ".2g"),
            walk["status"],
        )


def _shown(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
