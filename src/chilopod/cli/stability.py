"""``chilopod stability`` and ``chilopod bifurcation``: when does the straight walk hold, and where does it give way?"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from chilopod.cli.options import BetweenOption, OutOption, ParameterOption, RobotOptions, interval, with_options
from chilopod.cli.progress import progress_bar

if TYPE_CHECKING:
    from chilopod.analysis import StraightWalk, WalkBifurcation
    from chilopod.robot import Robot


@with_options
def stability(options: RobotOptions, out: OutOption = None) -> None:
    """Is the straight walk stable in the planar model? Its Floquet multipliers, exponents and modes.

    A small disturbance is a sum of modes. A mode grows with its exponent, and by its multiplier from one period T of
    the gait to the next: the walk is stable if every |multiplier| is below 1, every exponent's real part below 0.
    Exponents are the principal logarithms of the multipliers over T: their imaginary parts lie in (-pi/T, pi/T].
    """
    described = options.described
    files = options.free_in(out, "stability.json")
    from chilopod.analysis import straight_walk

    with progress_bar("stability"):
        found = straight_walk(described)
    options.deliver_json(files, found.as_json(), lambda: _print_stability(described, found))


def _print_stability(described: Robot, found: StraightWalk) -> None:
    typer.echo(f"{described.name}: the straight walk is {found.verdict} (period {described.gait.period:g} s)")
    typer.echo("  exponent (1/s)              |multiplier|   joint angles of the mode, front to rear")
    for exponent, modulus, components in zip(found.exponents.values, found.moduli, found.joint_components, strict=True):
        typer.echo(f"  {_complex(exponent, 6):<26}  {modulus:<12.6g}   {_components(components)}")
    nearer = "; the largest is nearer to 1 than that" if found.stable is None else ""
    typer.echo(f"  multipliers are within {found.exponents.multipliers.error_bound:.1e}{nearer}")


@with_options
def bifurcation(
    options: RobotOptions,
    parameter: ParameterOption,
    between: BetweenOption,
    seconds: Annotated[
        float, typer.Option(metavar="S", min=0.0, help="Time for the search, s; then it ends with what it has.")
    ] = 60.0,
    out: OutOption = None,
) -> None:
    """Where does the straight walk give way as one number of the robot varies, and how?

    Every bifurcation in the interval, that is every value at which the straight walk gains or loses stability: its
    kind, its error bound, the mode that grows, and whether what replaces the straight walk sets in gently
    (supercritical) or by a jump (subcritical).
    """
    described = options.described
    limits = interval(described, parameter, between)
    files = options.free_in(out, "bifurcation.json")
    from chilopod.analysis import bifurcations

    with progress_bar("bifurcation"):
        points = bifurcations(
            described,
            parameter,
            limits,
            remark=lambda text: typer.echo(f"note: {text}", err=True),
            seconds=seconds,
        )
    result = {"robot": described.name, "points": [point.as_json() for point in points]}
    options.deliver_json(files, result, lambda: _print_bifurcations(described, parameter, limits, points))


def _print_bifurcations(
    described: Robot, parameter: str, between: tuple[float, float], points: Sequence[WalkBifurcation]
) -> None:
    if not points:
        from chilopod import units

        ends = " and ".join(units.format(each, described.unit_of(parameter), digits=6) for each in between)
        typer.echo(f"{described.name}: no bifurcation of the straight walk for {parameter} between {ends}")
        return
    for each in points:
        point = each.point
        typer.echo(f"{point.kind.label} at {parameter} = {each.value:.12g} {each.unit} (± {each.error_bound:.1e})")
        typer.echo(f"  {point.kind.sentence}")
        if point.criticality.known:
            typer.echo(
                f"  {point.criticality.label}: {point.criticality.sentence} (coefficient {each.coefficient:.6g} /rad^2)"
            )
        if point.frequency:
            typer.echo(f"  {point.frequency:.6g} rad/s, a cycle of {2.0 * math.pi / point.frequency:.4g} s")
        typer.echo(f"  joint angles of the mode, front to rear: {_components(each.joint_components)}")


def _components(components: Iterable[complex]) -> str:
    return "  ".join(_complex(component, 3) for component in components)


def _complex(value: complex, digits: int) -> str:
    if abs(value.imag) < 1e-9:
        return f"{value.real:.{digits}g}"
    return f"{value.real:.{digits}g}{value.imag:+.{digits}g}i"
