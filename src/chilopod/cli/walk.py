"""``chilopod walk`` and ``chilopod turn``: let a robot walk, and let it walk to a target."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from chilopod.cli.options import (
    ClusterOption,
    ControllerOption,
    EngineOption,
    ForceOption,
    JsonOption,
    OutOption,
    RepeatsOption,
    RobotArg,
    SeedOption,
    SetOption,
    TrialsOption,
    prepared,
    print_json,
    read_robot,
    walking_on,
)
from chilopod.cli.own import own_code, own_controller
from chilopod.cli.progress import progress_bar

if TYPE_CHECKING:
    from chilopod.robot import Robot
    from chilopod.tasks import Turn


def walk(
    robot: RobotArg,
    duration: Annotated[str, typer.Option(metavar="TIME", help="How long.")] = "60 s",
    initial_joints: Annotated[
        str | None,
        typer.Option(metavar="ANGLES", help='Yaw joints at the start, front to rear: "2,0,0,0,0 deg"; one for all.'),
    ] = None,
    seed: SeedOption = None,
    repeats: RepeatsOption = 1,
    rate: Annotated[float | None, typer.Option(metavar="HZ", help="Samples per second, by default 100.")] = None,
    forces: Annotated[bool, typer.Option("--forces", help="Record the force on every foot.")] = False,
    engine: EngineOption = "planar",
    controller: ControllerOption = None,
    trials: TrialsOption = None,
    cluster: ClusterOption = None,
    overrides: SetOption = None,
    as_json: JsonOption = False,
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE.nc", help="Write the record as netCDF.")] = None,
    force: ForceOption = False,
) -> None:
    """Let a robot walk, once or many times, and say where it gets to.

    Radius and joint angles are means over the last 5 s, as in the paper.
    """
    from chilopod import units
    from chilopod.errors import ParameterError
    from chilopod.output import free_path, netcdf, write_atomic

    described = read_robot(robot, overrides)
    seconds = units.parse(duration, "s")
    angles = joint_angles(described, initial_joints)
    if repeats > 1 and seed is None:
        raise ParameterError("are all alike without --seed", field="repeats", value=repeats, allowed="1")
    path = None if out is None else free_path(out, force)
    from chilopod.record import RATE
    from chilopod.trials import NONE, Disturbance, Trial, run, summaries, together

    with own_code(), walking_on(cluster), progress_bar() as show:
        first = Trial(
            described,
            seconds,
            seed or 0,
            angles,
            controller=own_controller(controller),
            disturbance=NONE if seed is None else Disturbance(),
            rate=RATE if rate is None else rate,
            forces=forces,
            engine=engine,
        )
        asked = [replace(first, seed=first.seed + i) for i in range(repeats)]
        record = together(run(asked, trials, lambda done, words: show("walk", done, words)))
        added = creep(described, engine)
    found = summaries(described, record)
    if path:
        write_atomic(path, netcdf(record))
        typer.echo(f"wrote {path}", err=True)
    if as_json:
        walks = [{"seed": trial.seed, **each.as_json()} for trial, each in zip(asked, found, strict=True)]
        result = {"robot": described.name, "engine": engine, "controller": controller}
        print_json({**result, "duration_s": seconds, "seeded": seed is not None, "walks": walks} | added)
        return
    typer.echo(f"{described.name}, {engine}: {repeats} walk{'s' if repeats > 1 else ''} of {seconds:g} s")
    typer.echo("  seed    x (m)     y (m)     radius (m)  joint angles, mean of the last 5 s (deg)")
    for trial, each in zip(asked, found, strict=True):
        label = "-" if seed is None else str(trial.seed)
        if each.failed:
            typer.echo(f"  {label:<6}  {each.sentence}")
            continue
        bends = "  ".join(f"{angle:+7.2f}" for angle in each.joint_angles_deg)
        typer.echo(f"  {label:<6}  {each.x:<8.3f}  {each.y:<8.3f}  {each.axis_radius:<10.4g}  {bends}")
    for value in added.values():
        typer.echo(f"  standing feet creep like viscous ones of {value:.0f} N*s/m")


def creep(robot: Robot, engine: str) -> dict[str, float]:
    """How firmly the floor holds standing feet, for every run to show, where the engine's feet creep."""
    from chilopod.engine import HasFootCreep, engine_named

    walks = engine_named(engine)
    if not isinstance(walks, HasFootCreep):
        return {}
    found = walks.foot_creep(robot).across
    return {"foot_creep_N_s_m": found} if math.isfinite(found) else {}


def turn(
    robot: RobotArg,
    target: Annotated[
        str, typer.Option(metavar="BEARING, DISTANCE", help='Such as "45 deg, 1.3 m"; left is positive.')
    ],
    k1: Annotated[
        str,
        typer.Option(
            "--k1",
            metavar="auto|law|VALUE",
            help="The spring: what comes nearest in trials, the paper's from the settled radius, or a stiffness.",
        ),
    ] = "auto",
    strategy: Annotated[str, typer.Option(metavar="NAME", help="pitchfork, hopf, leg-yaw or open-loop.")] = "pitchfork",
    duration: Annotated[
        str | None, typer.Option(metavar="TIME", help="How long; by default what the circle takes, and some more.")
    ] = None,
    seed: SeedOption = None,
    repeats: RepeatsOption = 1,
    engine: EngineOption = "planar",
    controller: ControllerOption = None,
    trials: TrialsOption = None,
    cluster: ClusterOption = None,
    overrides: SetOption = None,
    as_json: JsonOption = False,
    out: OutOption = None,
    force: ForceOption = False,
) -> None:
    """Pick the spring that leads to a target, walk there, and say how well it went.

    With --out, draws the way and writes the record, and a replay that opens in any browser.
    """
    from chilopod import units
    from chilopod.steering import Target, strategy_named

    described = read_robot(robot, overrides)
    goal, chosen = Target.parse(target), strategy_named(strategy)
    spring = k1 if k1 in ("auto", "law") else units.parse(k1, "N*m/rad")
    seconds = None if duration is None else units.parse(duration, "s")
    folder = prepared(out)
    from chilopod.tasks import turn as walk_there

    if folder:
        from chilopod.output import free_path
        from chilopod.report.figures.turn import files_of_turn

        for path in files_of_turn(folder):
            free_path(path, force)
    with own_code(), walking_on(cluster), progress_bar() as show:
        done = walk_there(
            described,
            goal,
            chosen,
            spring,
            duration=seconds,
            seed=seed,
            repeats=repeats,
            engine=engine,
            controller=own_controller(controller),
            folder=trials,
            progress=lambda part, words: show("turn", part, words),
        )
        added = creep(described, engine)
    if folder:
        from chilopod.report.figures.turn import write_turn

        for path in write_turn(done, folder):
            typer.echo(f"wrote {path}", err=True)
    if as_json:
        print_json(done.as_json() | added)
        return
    _print_turn(done, seed)
    for value in added.values():
        typer.echo(f"  standing feet creep like viscous ones of {value:.0f} N*s/m")


def _print_turn(done: Turn, seed: int | None) -> None:
    from chilopod import units

    def shown(value: float) -> str:
        return units.format(value, "N*mm/deg", digits=4)

    found = done.criteria
    typer.echo(f"{done.robot.name}, {done.engine}, {done.strategy.name}: {done.strategy.sentence}")
    typer.echo(f"  target {done.target}: a circle of {done.target.radius:.3f} m")
    if done.by_law is not None:
        typer.echo(f"  spring by the settled radius (the paper's k1-hat): {shown(done.by_law)}")
    if done.stiffness is not None:
        typer.echo(f"  spring walked with: {shown(done.stiffness)}")
    typer.echo(f"  criteria at {found.time:.2f} s; nearest is at any time")
    typer.echo("  seed    outcome         arrival (s)  nearest (m)  eps1 (m)  eps2 (deg)  eps3 (rad2 s)")
    for i, outcome in enumerate(found.outcome):
        label = "-" if seed is None else str(seed + i)
        typer.echo(
            f"  {label:<6}  {outcome.label:<14}  {found.arrival[i]:<11.2f}  {found.nearest[i]:<11.4f}  "
            f"{found.distance[i]:<8.3f}  {math.degrees(found.angle[i]):<10.2f}  {found.effort[i]:.4f}"
        )


def joint_angles(robot: Robot, text: str | None) -> tuple[float, ...]:
    """Read ``"2,0,0,0,0 deg"``: numbers front to rear with one unit behind, or one number for all; rad."""
    from chilopod import units
    from chilopod.errors import ParameterError

    joints = robot.body.modules - 1
    if text is None:
        return (0.0,) * joints
    numbers = text.split(",")
    last, _, unit = numbers[-1].strip().partition(" ")
    each = tuple(units.parse(f"{number.strip()} {unit}".strip(), "rad") for number in [*numbers[:-1], last])
    if len(each) == 1:
        each *= joints
    if len(each) != joints:
        raise ParameterError(
            f"has {len(each)} angles", field="initial-joints", value=text, allowed=f"{joints}, or one for all"
        )
    if not all(abs(angle) <= 1.5 for angle in each):
        raise ParameterError("is bent too far", field="initial-joints", value=text, allowed="-85 to 85 deg")
    return each
