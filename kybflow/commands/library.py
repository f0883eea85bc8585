"""`kybflow library`."""

from __future__ import annotations

from typing import Annotated

import typer

from kybflow.commands.common import echo, examples

EXAMPLES = examples(
    "kybflow library",
    "kybflow library kybflow/airframes",
    "kybflow library line",
)


def library(
    name: Annotated[
        str | None,
        typer.Argument(help="A library, a mission or an entry; without it, all are listed."),
    ] = None,
) -> None:
    """What installed packages ship: airframes, vehicles, chains, stacks, worlds and missions."""
    from kybflow.library import list_shipped, show_shipped, unknown_name

    text = list_shipped() if name is None else show_shipped(name)
    if text is None:
        raise typer.BadParameter(unknown_name(name or ""), param_hint="NAME")
    echo(text)
