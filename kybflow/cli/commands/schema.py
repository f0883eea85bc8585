"""`kybflow schema`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import examples, published

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
    if not published(lambda: text, "kybflow schema", write_to, check):
        sys.stdout.write(text)
