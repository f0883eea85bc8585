"""`kybflow explain`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import examples, published
from kybflow.cli.output import echo

EXAMPLES = examples(
    "kybflow explain",
    "kybflow explain KYB203",
    "kybflow explain --check docs/checks.md",
)


def explain(
    code: Annotated[str | None, typer.Argument(help="Code of a finding, such as KYB203.")] = None,
    write_to: Annotated[
        Path | None, typer.Option("--write", help="Write the page of all codes to this file.")
    ] = None,
    check: Annotated[Path | None, typer.Option(help="Fail unless this page is current.")] = None,
) -> None:
    """What a finding means and how to mend it; without a code, all of them by family."""
    from kybflow.dsl.diagnostics.codes import codes, list_codes, page, show_code, unknown_code

    if published(page, "kybflow explain", write_to, check):
        return
    if code is None:
        echo(list_codes())
    elif code.upper() in codes():
        echo(show_code(codes()[code.upper()]))
    else:
        raise typer.BadParameter(unknown_code(code), param_hint="CODE")
