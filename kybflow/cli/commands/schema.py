"""`kybflow schema`."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from kybflow.cli.arguments import PATH, Subcommand, examples, published

EXAMPLES = examples(
    "kybflow schema > mission.schema.json",
    "kybflow schema --check schemas/mission.schema.json",
)


@click.command("schema", cls=Subcommand, epilog=EXAMPLES)
@click.option("--write", "write_to", type=PATH, help="Write it to this file.")
@click.option("--check", type=PATH, help="Fail unless this file is current.")
def command(write_to: Path | None, check: Path | None) -> None:
    """The JSON Schema of a mission, made from the parts that are installed; editors complete from
    it."""
    from kybflow.dsl.language.published import schema_text
    from kybflow.parts.catalog import load_catalog

    text = schema_text(load_catalog())
    if not published(lambda: text, "kybflow schema", write_to, check):
        sys.stdout.write(text)
