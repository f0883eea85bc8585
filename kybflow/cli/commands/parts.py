"""`kybflow parts`."""

from __future__ import annotations

from typing import Annotated

from typer import Argument, Option

from kybflow.cli.arguments import Check, WriteTo, published, unknown
from kybflow.cli.output import echo


def command(
    name: Annotated[str | None, Argument(help="Name of a part; by default all are listed.")] = None,
    api: Annotated[bool, Option("--api", help="The page for authors of parts.")] = False,
    write_to: WriteTo = None,
    check: Check = None,
) -> None:
    """List the behaviors, estimators, processors, trackers, supervisors, drivers, faults and
    actions, or document one.

    --write and --check are for the page of kybflow's own parts.

    \b
    Examples:
      kybflow parts
      kybflow parts circle
      kybflow parts --check docs/parts.md
      kybflow parts --api --write docs/parts-in-python.md
    """
    if api:
        from kybflow.cli.printing import authors

        if not published(authors.page, "kybflow parts --api", write_to, check):
            echo(authors.page())
        return
    from kybflow.cli.printing.reference import list_parts, page, show_part
    from kybflow.parts.catalog import load_catalog

    if published(page, "kybflow parts", write_to, check):
        return
    catalog = load_catalog()
    if name is None:
        echo(list_parts(catalog))
    elif text := show_part(catalog, name):
        echo(text)
    else:
        known = (known for kind in catalog.kinds() for known in catalog.names(kind))
        raise unknown("there is no part", name, known, "NAME")
