"""`kybflow schema`."""

from __future__ import annotations

import sys

from kybflow.cli.arguments import Check, WriteTo, published


def command(write_to: WriteTo = None, check: Check = None) -> None:
    """The JSON Schema of a mission, made from the parts that are installed; editors complete from
    it.

    \b
    Examples:
      kybflow schema > mission.schema.json
      kybflow schema --check schemas/mission.schema.json
    """
    from kybflow.dsl.language.published import schema_text
    from kybflow.parts.catalog import load_catalog

    text = schema_text(load_catalog())
    if not published(lambda: text, "kybflow schema", write_to, check):
        sys.stdout.write(text)
