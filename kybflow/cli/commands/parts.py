"""`kybflow parts`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import INVALID, echo, examples, write

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
    from kybflow.cli.printing.parts import list_parts, show_part, unknown_part
    from kybflow.cli.printing.parts_page import page
    from kybflow.parts.catalog import load_catalog

    if write_to is not None:
        write(write_to, page(), "--write")
    elif check is not None:
        if not check.is_file() or check.read_text(encoding="utf-8") != page():
            echo(f"{check} is not current; mend it with: kybflow parts --write {check}", err=True)
            raise typer.Exit(INVALID)
    elif name is None:
        echo(list_parts(load_catalog()))
    else:
        catalog = load_catalog()
        text = show_part(catalog, name)
        if text is None:
            raise typer.BadParameter(unknown_part(catalog, name), param_hint="NAME")
        echo(text)
