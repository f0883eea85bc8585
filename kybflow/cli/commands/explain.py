"""`kybflow explain`."""

from __future__ import annotations

from typing import Annotated

from typer import Argument

from kybflow.cli.arguments import Check, WriteTo, published, unknown
from kybflow.cli.output import echo


def command(
    code: Annotated[str | None, Argument(help="Code of a finding, such as KYB203.")] = None,
    write_to: WriteTo = None,
    check: Check = None,
) -> None:
    """Explain a finding and its fix; without a code, list all findings.

    --write and --check are for the page of all codes.

    \b
    Examples:
      kybflow explain
      kybflow explain KYB203
      kybflow explain --check docs/checks.md
    """
    from kybflow.api.codes import codes, list_codes, page, show_code

    if published(page, "kybflow explain", write_to, check):
        return
    if code is None:
        echo(list_codes())
    elif found := codes().get(code.upper()):
        echo(show_code(found))
    else:
        raise unknown("no finding has the code", code, codes(), "CODE")
