"""`kybflow explain`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import INVALID, echo, examples, write

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
    """What a finding means and how it is mended; without a code, all of them by family."""
    from kybflow.dsl.diagnostics.codes import codes, list_codes, page, show_code, unknown_code

    if write_to is not None:
        write(write_to, page(), "--write")
    elif check is not None:
        if not check.is_file() or check.read_text(encoding="utf-8") != page():
            echo(f"{check} is not current; mend it with: kybflow explain --write {check}", err=True)
            raise typer.Exit(INVALID)
    elif code is None:
        echo(list_codes())
    elif code.upper() in codes():
        echo(show_code(codes()[code.upper()]))
    else:
        raise typer.BadParameter(unknown_code(code), param_hint="CODE")
