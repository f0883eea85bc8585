"""`kybflow new`."""

from __future__ import annotations

from pathlib import Path

import click
from click.exceptions import Exit

from kybflow.cli.arguments import Subcommand, argument, examples
from kybflow.cli.output import echo
from kybflow.core.errors import KybflowError
from kybflow.core.exit_codes import INVALID

EXAMPLES = examples(
    "kybflow new hop",
    "kybflow new my_eight --from figure_eight",
)


@click.command("new", cls=Subcommand, epilog=EXAMPLES)
@argument("name", "Its name; NAME.yaml is written beside you.")
@click.option(
    "--from",
    "origin",
    metavar="MISSION",
    default="first_flight",
    help="The shipped mission to begin from.",
)
def command(name: str, origin: str) -> None:
    """Begin a mission of your own from one that is shipped; overwrites nothing.

    The files that the mission names are written beside it, and the schema that editors complete
    from.
    """
    from kybflow.api.scaffold import scaffold

    try:
        written = scaffold(name, origin, Path())
    except KybflowError as error:
        echo(f"kybflow: {error}", err=True)
        raise Exit(INVALID) from None
    for path in written:
        echo(f"wrote {path}")
    echo(f"fly it: kybflow run {name}.yaml")
