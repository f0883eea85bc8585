"""`kybflow schema`."""

from __future__ import annotations

import sys

from kybflow.cli.arguments import Check, WriteTo, published, unknown


def command(write_to: WriteTo = None, check: Check = None) -> None:
    """Print the JSON Schema of missions with all installed parts, for editors. With a Markdown
    file, update its tables of keys.

    \b
    Examples:
      kybflow schema > mission.schema.json
      kybflow schema --check schemas/mission.schema.json
      kybflow schema --write docs/mission-language.md
    """
    from kybflow.dsl.language.published import schema_text
    from kybflow.dsl.language.tables import records, with_tables
    from kybflow.parts.catalog import load_catalog

    page = write_to or check
    try:
        has_tables = page is not None and page.suffix == ".md" and page.is_file()
        text = with_tables(page) if page and has_tables else schema_text(load_catalog())
    except KeyError as title:
        raise unknown("there is no record", title.args[0], records(), "--write") from None
    if not published(lambda: text, "kybflow schema", write_to, check):
        sys.stdout.write(text)
