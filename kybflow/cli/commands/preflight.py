"""`kybflow preflight`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from kybflow.cli.arguments import (
    PATH,
    Subcommand,
    argument,
    compiled,
    examples,
    seed_option,
    set_option,
    target_option,
)
from kybflow.cli.output import echo
from kybflow.core.details import details, headline

if TYPE_CHECKING:
    from kybflow.dsl.plan import Plan
    from kybflow.runtime.preflight import PreflightResult

EXAMPLES = examples(
    "kybflow preflight missions/figure_eight.yaml",
    "kybflow preflight missions/figure_eight.yaml --target lab",
)
RED, FAILED = 1, 3


@click.command("preflight", cls=Subcommand, epilog=EXAMPLES)
@argument("mission", "The mission that is to fly.", type=PATH)
@target_option
@set_option
@seed_option
def command(mission: Path, target: str | None, sets: tuple[str, ...], seed: int) -> None:
    """Look at everything that must be well before take-off; nothing arms.

    \b
    Exit codes:
    0: every line is green.
    1: one is red.
    2: the mission is invalid.
    3: a driver or device failed.
    """
    plan, result = compiled(mission, target, sets)
    raise Exit(_inspect(plan, result.texts, seed))


def _inspect(plan: Plan, texts: dict[str, str], seed: int) -> int:
    from kybflow.api.flight import inspect
    from kybflow.api.rehearsal.rehearse import rehearse
    from kybflow.cli.printing.rehearsal import preflight_line
    from kybflow.core.errors import DriverError, PartFailed

    try:
        rehearsed = preflight_line(rehearse(plan, texts=texts))
        found = inspect(plan, seed)
    except DriverError as error:
        echo(f"error: {error}", err=True)
        return FAILED
    except PartFailed as failure:
        echo(f"error: `{failure.part}` can't be made: {failure}", err=True)
        return RED
    lines = [*found.lines, rehearsed]
    echo("\n".join(table(lines)))
    if found.driver_failed:
        return FAILED
    return 0 if all(line.green for line in lines) else RED


def table(lines: Sequence[PreflightResult]) -> list[str]:
    """The lines in columns: red or green, vehicle, check, reason, mission line; below a line the
    table that its reason carries."""
    names = max(len(line.vehicle) for line in lines)
    checks = max(len(line.check) for line in lines)
    margin = " " * (len("green") + names + checks + 8)
    found = []
    for line in lines:
        colour, at = "green" if line.green else "RED  ", f"  [{line.at}]" if line.at else ""
        reason = headline(line.reason)
        found.append(f"{colour}  {line.vehicle:{names}}  {line.check:{checks}}  {reason}{at}")
        found += [f"{margin}{row}" for row in details(line.reason)]
    return found
