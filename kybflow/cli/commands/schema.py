"""`kybflow schema`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import INVALID, echo, examples, write

EXAMPLES = examples(
    "kybflow schema > mission.schema.json",
    "kybflow schema --check schemas/mission.schema.json",
)


def schema(
    write_to: Annotated[Path | None, typer.Option("--write", help="Write it to this file.")] = None,
    check: Annotated[Path | None, typer.Option(help="Fail unless this file is current.")] = None,
) -> None:
    """The JSON Schema of a mission, made from the parts that are installed; editors complete from
    it."""
    from kybflow.dsl.schema.published import schema_text
    from kybflow.parts.catalog import load_catalog

    text = schema_text(load_catalog())
    if write_to is not None:
        write(write_to, text, "--write")
    elif check is not None:
        if not check.is_file() or check.read_text(encoding="utf-8") != text:
            echo(f"{check} is not current; mend it with: kybflow schema --write {check}", err=True)
            raise typer.Exit(INVALID)
    else:
        sys.stdout.write(text)
