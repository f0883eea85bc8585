"""`kybflow rehearse`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Exit

from kybflow.cli.arguments import Changes, Emits, Format, Parts, Sets, Target, compiled, failing
from kybflow.cli.output import echo
from kybflow.core.errors import FAILED, INVALID, KybflowError


def command(
    mission: Annotated[Path, Argument(help="The mission to rehearse.")],
    *,
    target: Target = None,
    sets: Sets,
    parts: Parts,
    options: Changes,
    emits: Emits,
    format: Format = "text",
) -> None:
    """Fly a mission on ideal vehicles, as fast as possible, and print the findings.

    The rehearsal gives a person's event two seconds after the mission begins to wait for it, unless
    --emit sets its time.

    \b
    Exit codes:
    0: no finding is an error.
    1: a finding is an error.
    2: the mission or the command line is invalid.

    \b
    Examples:
      kybflow rehearse missions/formation.yaml
      kybflow rehearse missions/courier.yaml --target lab --format json
      kybflow rehearse missions/joystick.yaml --target hands --emit stick.take@8s
    """
    from kybflow.api.rehearsal.rehearse import formatted, rehearse

    plan, result = compiled(mission, target, sets, parts)
    with failing(INVALID, KybflowError):
        found = rehearse(plan, emits, options, result.texts)
    for text in formatted(found, result.texts, format):
        echo(text)
    raise Exit(0 if found.is_clean else FAILED)
