"""`kybflow rehearse`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from kybflow.cli.arguments import (
    PATH,
    Subcommand,
    argument,
    compiled,
    emit_option,
    examples,
    option_option,
    pair,
    set_option,
    target_option,
    timed,
)
from kybflow.cli.output import echo
from kybflow.core.errors import KybflowError
from kybflow.core.exit_codes import FAILED, INVALID

if TYPE_CHECKING:
    from kybflow.api.rehearsal.rehearse import Rehearsal

EXAMPLES = examples(
    "kybflow rehearse missions/formation.yaml",
    "kybflow rehearse missions/courier.yaml --target lab --format json",
    "kybflow rehearse missions/joystick.yaml --target hands --emit stick.take@8s",
)


@click.command("rehearse", cls=Subcommand, epilog=EXAMPLES)
@argument("mission", "The mission to rehearse.", type=PATH)
@target_option
@set_option
@option_option
@emit_option
@click.option(
    "--format",
    type=click.Choice(["text", "json", "sarif", "github"]),
    default="text",
    help="For people, programs, code scanning or GitHub Actions.",
)
def command(
    mission: Path,
    target: str | None,
    sets: tuple[str, ...],
    options: tuple[str, ...],
    emits: tuple[str, ...],
    format: str,
) -> None:
    """Fly a mission on ideal vehicles, in a moment, and say what goes wrong in it.

    A person's events come two seconds after they are waited for, unless --emit says when.

    \b
    Exit codes:
    0: nothing goes wrong, whatever it warns of.
    1: something does.
    2: the mission or the command line is invalid.
    """
    from kybflow.api.rehearsal.rehearse import rehearse

    given = tuple(timed(emit) for emit in emits)
    changes = tuple(pair(option) for option in options)
    plan, result = compiled(mission, target, sets)
    try:
        rehearsal = rehearse(plan, given, changes, result.texts)
    except KybflowError as error:
        echo(f"error: {error}", err=True)
        raise Exit(INVALID) from None
    _tell(rehearsal, result.texts, format)
    raise Exit(0 if rehearsal.is_clean else FAILED)


def _tell(rehearsal: Rehearsal, texts: dict[str, str], format: str) -> None:
    from kybflow.cli.printing.rehearsal import as_json, reports

    if format == "json":
        echo(as_json(rehearsal))
    elif format == "text":
        for text in reports(rehearsal, texts):
            echo(text)
    else:
        from kybflow.dsl.diagnostics.formats import to_annotation, to_sarif

        found = rehearsal.diagnostics
        for text in [to_sarif(found)] if format == "sarif" else map(to_annotation, found):
            echo(text)
