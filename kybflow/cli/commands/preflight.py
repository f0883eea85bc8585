"""`kybflow preflight`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Exit

from kybflow.cli.arguments import Seed, Sets, Target, compiled, failing
from kybflow.cli.output import columns, echo
from kybflow.core.errors import DRIVER_FAILED, FAILED
from kybflow.core.text import INDENT, details, headline

if TYPE_CHECKING:
    from kybflow.runtime.preflight import PreflightResult


def command(
    mission: Annotated[Path, Argument(help="The mission to check.")],
    *,
    target: Target = None,
    sets: Sets,
    seed: Seed = 0,
) -> None:
    """Run all checks before take-off; no vehicle arms.

    \b
    Exit codes:
    0: every line is green.
    1: a line is red.
    2: the mission is invalid.
    3: a driver or device failed.

    \b
    Examples:
      kybflow preflight missions/figure_eight.yaml
      kybflow preflight missions/figure_eight.yaml --target lab
    """
    from kybflow.api.flight import inspect
    from kybflow.api.rehearsal.rehearse import preflight_line, rehearse
    from kybflow.core.errors import DriverError, PartFailed

    plan, result = compiled(mission, target, sets)
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


def table(lines: Sequence[PreflightResult]) -> list[str]:
    """Format the results as columns: red or green, vehicle, check, reason and mission line. A table
    in a reason follows below its line."""
    found, rows = [], []
    for line in lines:
        reason = headline(line.reason) + (f"  [{line.at}]" if line.at else "")
        rows.append(("green" if line.green else "RED  ", line.vehicle, line.check, reason))
    for line, row, text in zip(lines, rows, columns(rows), strict=True):
        margin = " " * (len(text) - len(row[-1])) + INDENT
        found += [text, *(f"{margin}{detail}" for detail in details(line.reason))]
    return found
