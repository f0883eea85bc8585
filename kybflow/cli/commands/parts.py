"""`kybflow parts`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import examples, published
from kybflow.cli.output import echo

EXAMPLES = examples(
    "kybflow parts",
    "kybflow parts circle",
    "kybflow parts --check docs/parts.md",
)


def parts(
    name: Annotated[str | None, typer.Argument(help="A part; without it, all are listed.")] = None,
    write_to: Annotated[
        Path | None, typer.Option("--write", help="Write the page of kybflow's own parts here.")
    ] = None,
    check: Annotated[Path | None, typer.Option(help="Fail unless this page is current.")] = None,
) -> None:
    """What behaviors, estimators, processors, trackers, supervisors, drivers, faults and actions
    there are."""
    from kybflow.cli.printing.parts import list_parts, page, show_part, unknown_part
    from kybflow.parts.catalog import load_catalog

    if published(page, "kybflow parts", write_to, check):
        return
    if name is None:
        echo(list_parts(load_catalog()))
    else:
        catalog = load_catalog()
        text = show_part(catalog, name)
        if text is None:
            raise typer.BadParameter(unknown_part(catalog, name), param_hint="NAME")
        echo(text)
