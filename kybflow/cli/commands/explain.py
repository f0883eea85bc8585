"""`kybflow explain`."""

from __future__ import annotations

from pathlib import Path

import click

from kybflow.cli.arguments import PATH, Subcommand, argument, examples, published
from kybflow.cli.output import echo

EXAMPLES = examples(
    "kybflow explain",
    "kybflow explain KYB203",
    "kybflow explain --check docs/checks.md",
)


@click.command("explain", cls=Subcommand, epilog=EXAMPLES)
@argument("code", "Code of a finding, such as KYB203.", required=False)
@click.option("--write", "write_to", type=PATH, help="Write the page of all codes to this file.")
@click.option("--check", type=PATH, help="Fail unless this page is current.")
def command(code: str | None, write_to: Path | None, check: Path | None) -> None:
    """What a finding means and how to mend it; without a code, all of them by family."""
    from kybflow.dsl.diagnostics.codes import codes, list_codes, page, show_code, unknown_code

    if published(page, "kybflow explain", write_to, check):
        return
    if code is None:
        echo(list_codes())
    elif code.upper() in codes():
        echo(show_code(codes()[code.upper()]))
    else:
        raise click.BadParameter(unknown_code(code), param_hint="CODE")
