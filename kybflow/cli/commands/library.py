"""`kybflow library`."""

from __future__ import annotations

from pathlib import Path

import click
from click.exceptions import Exit

from kybflow.cli.arguments import Subcommand, argument, examples
from kybflow.cli.output import echo
from kybflow.core.errors import KybflowError
from kybflow.core.exit_codes import INVALID

EXAMPLES = examples(
    "kybflow library",
    "kybflow library kybflow/airframes",
    "kybflow library line",
    "kybflow library missions/survey.yaml",
)


@click.command("library", cls=Subcommand, epilog=EXAMPLES)
@argument(
    "name",
    "A library, a mission, an entry, a file or an import's name; else all are listed.",
    required=False,
)
def command(name: str | None) -> None:
    """What installed packages ship: airframes, vehicles, chains, stacks, worlds and missions. Of a
    file: what it offers, and what it imports."""
    from kybflow.cli.printing.library import (
        list_shipped,
        show_file,
        show_import,
        show_shipped,
        unknown_name,
    )

    if name is None:
        echo(list_shipped())
        return
    try:
        is_file = Path(name).suffix in (".yaml", ".yml")
        text = show_file(Path(name)) if is_file else show_shipped(name) or show_import(name)
    except KybflowError as error:
        echo(str(error), err=True)
        raise Exit(INVALID) from None
    if text is None:
        raise click.BadParameter(unknown_name(name), param_hint="NAME")
    echo(text)
