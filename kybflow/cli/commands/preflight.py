"""`kybflow preflight`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

from typer import Argument, Exit, Option

from kybflow.cli.arguments import Parts, Seed, Sets, Target, compiled, failing, wrong
from kybflow.cli.output import columns, echo, printer
from kybflow.core.errors import DRIVER_FAILED, FAILED
from kybflow.core.text import INDENT, details, headline
from kybflow.dsl.resolving.library_files import without_homes

if TYPE_CHECKING:
    from kybflow.dsl.plan import Plan
    from kybflow.runtime.preflight import PreflightResult


def command(
    mission: Annotated[Path, Argument(help="The mission to check.")],
    *,
    target: Target = None,
    sets: Sets,
    parts: Parts,
    seed: Seed = 0,
    by_hand: Annotated[
        str | None,
        Option(
            "--by-hand",
            metavar="NAME",
            help="Move this vehicle by hand, as asked, to check its motion capture.",
        ),
    ] = None,
) -> None:
    """Run all checks before take-off; no vehicle arms.

    With --by-hand, only the motion capture of one vehicle is checked: its scale, axes and heading,
    while a person lifts the vehicle, carries it and dips its nose. A simulated hand moves a
    simulated vehicle.

    \b
    Exit codes:
    0: every line is green.
    1: a line is red, or the check by hand was not finished.
    2: the mission is invalid, or has no such vehicle or no motion capture.
    3: a driver or device failed.

    \b
    Examples:
      kybflow preflight missions/figure_eight.yaml
      kybflow preflight missions/figure_eight.yaml --target lab
      kybflow preflight missions/figure_eight.yaml --target lab --by-hand mk
    """
    from kybflow.api.flight import inspect
    from kybflow.api.rehearsal.rehearse import preflight_line, rehearse
    from kybflow.core.errors import DriverError, PartFailed

    plan, result = compiled(mission, target, sets, parts)
    if by_hand is not None:
        _check_by_hand(plan, by_hand, seed)
    try:
        with failing(DRIVER_FAILED, DriverError):
            rehearsed = preflight_line(rehearse(plan, texts=result.texts))
            found = inspect(plan, seed)
    except PartFailed as failure:
        echo(f"error: `{failure.part}` can't be made: {failure}", err=True)
        raise Exit(FAILED) from None
    lines = [*found.lines, rehearsed]
    echo("\n".join(table(lines)))
    if found.driver_failed:
        raise Exit(DRIVER_FAILED)
    raise Exit(0 if all(line.green for line in lines) else FAILED)


def _check_by_hand(plan: Plan, name: str, seed: int) -> NoReturn:
    """Lead a person through the check by hand; print the verdict and exit."""
    from kybflow.api.by_hand import Tell, check_by_hand, objection
    from kybflow.cli.printing.by_hand import asked, shown
    from kybflow.core.errors import DriverError, KybflowError

    if name not in plan.fleet:
        names = ", ".join(f"`{other}`" for other in plan.fleet)
        raise wrong("--by-hand", f"there is no vehicle `{name}`; the mission has {names}")
    reason = objection(plan.fleet[name])
    if reason is not None:
        raise wrong("--by-hand", reason)
    say = printer(sys.stdout)
    tell = Tell(
        ask=lambda step: say(asked(step, name)),
        done=lambda motion: say(shown(motion)),
        warn=lambda reason: say(f"  {reason}"),
        simulated=lambda: say(f"{name} is simulated, and so is the hand that moves it."),
    )
    with failing(FAILED, KybflowError), failing(DRIVER_FAILED, DriverError):
        found = check_by_hand(plan, name, tell, seed)
    for line in table(found.lines):
        echo(line)
    if found.stopped is not None:
        echo(f"error: the check was not finished: {found.stopped}", err=True)
    red = found.stopped is not None or not all(line.green for line in found.lines)
    raise Exit(FAILED if red else 0)


def table(lines: Sequence[PreflightResult]) -> list[str]:
    """Format the results as columns: red or green, vehicle, check, reason and mission line. A table
    in a reason follows below its line."""
    found, rows = [], []
    for line in lines:
        reason = headline(line.reason) + (f"  [{without_homes(line.at)}]" if line.at else "")
        rows.append(("green" if line.green else "RED  ", line.vehicle, line.check, reason))
    for line, row, text in zip(lines, rows, columns(rows), strict=True):
        margin = " " * (len(text) - len(row[-1])) + INDENT
        found += [text, *(f"{margin}{detail}" for detail in details(line.reason))]
    return found
