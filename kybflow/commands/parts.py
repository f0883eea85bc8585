"""`kybflow parts`."""

from __future__ import annotations

from typing import Annotated

import typer

from kybflow.commands.common import echo

EXAMPLES = "Examples:  kybflow parts  |  kybflow parts circle"


def parts(
    name: Annotated[str | None, typer.Argument(help="A part; without it, all are listed.")] = None,
) -> None:
    """What behaviors, estimators, processors, trackers, supervisors, drivers, faults and actions
    there are."""
    from kybflow.catalog import load_catalog
    from kybflow.listing import list_parts, show_part, unknown_part

    catalog = load_catalog()
    text = list_parts(catalog) if name is None else show_part(catalog, name)
    if text is None:
        raise typer.BadParameter(unknown_part(catalog, name or ""), param_hint="NAME")
    echo(text)
