"""`kybflow library`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import INVALID, examples
from kybflow.cli.output import echo
from kybflow.core.errors import KybflowError

EXAMPLES = examples(
    "kybflow library",
    "kybflow library kybflow/airframes",
    "kybflow library line",
    "kybflow library missions/survey.yaml",
)


def library(
    name: Annotated[
        str | None,
        typer.Argument(
            help="A library, a mission, an entry, a file or an import's name; else all are listed."
        ),
    ] = None,
) -> None:
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
        raise typer.Exit(INVALID) from None
    if text is None:
        raise typer.BadParameter(unknown_name(name), param_hint="NAME")
    echo(text)
