"""`kybflow parts`."""

from __future__ import annotations

from pathlib import Path

import click

from kybflow.cli.arguments import PATH, Subcommand, argument, examples, published
from kybflow.cli.output import echo

EXAMPLES = examples(
    "kybflow parts",
    "kybflow parts circle",
    "kybflow parts --check docs/parts.md",
)


@click.command("parts", cls=Subcommand, epilog=EXAMPLES)
@argument("name", "A part; without it, all are listed.", required=False)
@click.option("--write", "write_to", type=PATH, help="Write the page of kybflow's own parts here.")
@click.option("--check", type=PATH, help="Fail unless this page is current.")
def command(name: str | None, write_to: Path | None, check: Path | None) -> None:
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
            raise click.BadParameter(unknown_part(catalog, name), param_hint="NAME")
        echo(text)
