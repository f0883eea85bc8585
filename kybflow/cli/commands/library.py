"""`kybflow library`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument

from kybflow.cli.arguments import failing, unknown
from kybflow.cli.output import echo
from kybflow.core.errors import INVALID, KybflowError


def command(
    name: Annotated[
        str | None,
        Argument(help="A library, mission, entry, file or import; by default all are listed."),
    ] = None,
) -> None:
    """Show what installed packages ship: airframes, vehicles, chains, stacks, worlds and missions;
    or what a file offers and imports.

    \b
    Examples:
      kybflow library
      kybflow library kybflow/airframes
      kybflow library line
      kybflow library missions/survey.yaml
    """
    from kybflow.cli.printing.reference import (
        known_names,
        list_shipped,
        show_file,
        show_import,
        show_shipped,
    )

    if name is None:
        echo(list_shipped())
        return
    is_file = Path(name).suffix in (".yaml", ".yml")
    with failing(INVALID, KybflowError, word=""):
        text = show_file(Path(name)) if is_file else show_shipped(name) or show_import(name)
    if text is None:
        raise unknown("there is no library, mission, entry or import", name, known_names(), "NAME")
    echo(text)
