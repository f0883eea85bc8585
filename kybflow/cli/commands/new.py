"""`kybflow new`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from kybflow.cli.arguments import failing
from kybflow.cli.output import echo
from kybflow.core.errors import INVALID, KybflowError


def command(
    name: Annotated[str, Argument(help="Its name; the file is NAME.yaml in the current folder.")],
    origin: Annotated[
        str, Option("--from", metavar="MISSION", help="The shipped mission to copy.")
    ] = "first_flight",
) -> None:
    """Start a mission from a shipped one; never overwrites a file.

    It also writes the files that the mission uses, and the schema for editors.

    \b
    Examples:
      kybflow new hop
      kybflow new my_eight --from figure_eight
    """
    from kybflow.api.library import scaffold

    with failing(INVALID, KybflowError, word="kybflow: "):
        written = scaffold(name, origin, Path())
    for path in written:
        echo(f"wrote {path}")
    echo(f"fly it: kybflow run {name}.yaml")
