"""`kybflow run`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import RunOut, Seed, Sets, Target, console, examples
from kybflow.core.errors import UnitError
from kybflow.core.units import DURATION, parse_quantity

EXAMPLES = examples(
    "kybflow run missions/figure_eight.yaml",
    "kybflow run missions/figure_eight.yaml --set lap=8s --seed 3",
    "kybflow run missions/first_flight.yaml --speed 1 --live",
)


def run(
    mission: Annotated[Path, typer.Argument(help="The mission to fly.")],
    target: Target = None,
    sets: Sets = None,
    seed: Seed = 0,
    out: RunOut = None,
    speed: Annotated[
        float | None,
        typer.Option(
            min=0.01, help="Pace of a simulation, 1 is real time; else as fast as it goes."
        ),
    ] = None,
    options: Annotated[
        list[str] | None,
        typer.Option(
            "--option",
            metavar="NAME=VALUE",
            help="Change a parameter of a part, like mk.processors.limit_speed.speed=50cm/s.",
        ),
    ] = None,
    emits: Annotated[
        list[str] | None,
        typer.Option(
            "--emit",
            metavar="NAME@TIME",
            help="Give an event while it flies, like operator.go@2s; TIME is that of the run. "
            "operator.pause, .resume, .land, .reset and .stop act on every vehicle.",
        ),
    ] = None,
    live: Annotated[bool, typer.Option("--live", help="Show the simulation in a window.")] = False,
    plain: Annotated[bool, typer.Option("--plain", help="Events as lines, no table.")] = False,
    report: Annotated[bool, typer.Option(help="Write report.html.")] = True,
) -> None:
    """Fly a mission and report.

    Exit codes:

    0: it ended as it should and every expectation held.
    1: it did not, or its record could not be written.
    2: the mission or the command line is invalid.
    3: a driver or device failed.
    130: interrupted.
    """
    from kybflow.api.flight import RunRequest
    from kybflow.api.running import Asked, run_mission

    pace = 1.0 if live and speed is None else speed
    changes = tuple(_pair(option) for option in options or ())
    given = tuple(_timed(emit) for emit in emits or ())
    request = RunRequest(seed, out, pace, changes, given, tuple(sets or ()))
    asked = Asked(mission, target, request, live, plain, report)
    screen, errors = (console(stream) for stream in (sys.stdout, sys.stderr))
    raise typer.Exit(run_mission(asked, screen, errors))


def _timed(emit: str) -> tuple[float, str]:
    """(seconds, name) of `NAME@TIME`."""
    name, at, time = emit.rpartition("@")
    if not at or not name.strip():
        raise typer.BadParameter(f"`{emit}` is not NAME@TIME", param_hint="--emit")
    try:
        seconds = parse_quantity(time, DURATION)
    except UnitError as error:
        reason = f"`{emit}`: {error}; {error.hint}" if error.hint else f"`{emit}`: {error}"
        raise typer.BadParameter(reason, param_hint="--emit") from None
    if seconds < 0.0:
        raise typer.BadParameter(f"`{emit}` is before the run", param_hint="--emit")
    return seconds, name.strip()


def _pair(option: str) -> tuple[str, str]:
    name, equals, value = option.partition("=")
    if not equals:
        raise typer.BadParameter(f"`{option}` is not NAME=VALUE", param_hint="--option")
    return name.strip(), value.strip()
