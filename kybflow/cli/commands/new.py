"""`kybflow new`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import INVALID, examples
from kybflow.cli.output import echo
from kybflow.core.errors import KybflowError

EXAMPLES = examples(
    "kybflow new hop",
    "kybflow new my_eight --from figure_eight",
)


def new(
    name: Annotated[str, typer.Argument(help="Its name; NAME.yaml is written beside you.")],
    origin: Annotated[
        str, typer.Option("--from", metavar="MISSION", help="The shipped mission to begin from.")
    ] = "first_flight",
) -> None:
    """Begin a mission of your own from one that is shipped; overwrites nothing.

    The files that the mission names are written beside it,
    and the schema that editors complete from."""
    from kybflow.api.scaffold import scaffold

    try:
        written = scaffold(name, origin, Path())
    except KybflowError as error:
        echo(f"kybflow: {error}", err=True)
        raise typer.Exit(INVALID) from None
    for path in written:
        echo(f"wrote {path}")
    echo(f"fly it: kybflow run {name}.yaml")
