"""`kybflow compare`."""

from __future__ import annotations

import json
from itertools import groupby
from pathlib import Path
from typing import Annotated

from typer import Argument, Exit, Option

from kybflow.cli.arguments import failing
from kybflow.cli.output import echo
from kybflow.core.errors import FAILED, KybflowError

_LONGEST = 60
"""Characters of a value that are shown."""


def command(
    runs: Annotated[list[Path], Argument(help="Two or more run folders.")],
    *,
    as_json: Annotated[bool, Option("--json", help="Output for programs.")] = False,
    html: Annotated[Path | None, Option(help="Write a page with figures to this file.")] = None,
    whole: Annotated[bool, Option("--all", help="Show also what is the same.")] = False,
) -> None:
    """Compare runs: outcome, code, parameters, errors, expectations, the first different event.

    Only what differs is shown, but for the errors, unless with --all. The page of --html shows all.

    \b
    Exit codes:
    0: the runs are compared.
    1: a run can't be read, or the page can't be written.

    \b
    Examples:
      kybflow compare runs/eight-1 runs/eight-2
      kybflow compare runs/* --json
      kybflow compare runs/* --html comparison.html
    """
    from kybflow.api.compare import compare
    from kybflow.api.runs import Run

    with failing(FAILED, KybflowError):
        loaded = [Run.load(folder) for folder in runs]
        every = compare(loaded)
        if html is not None:
            from kybflow.report.comparison import write_comparison

            write_comparison(html, runs, every)
            echo(str(html))
            raise Exit(0)
    rows = [row for row in every if whole or row.differs or row.section == "error"]
    if as_json:
        facts = [{"section": r.section, "name": r.name, "values": r.values} for r in rows]
        echo(json.dumps({"kybflow": 1, "runs": [*map(str, runs)], "rows": facts}, indent=2))
        raise Exit(0)
    names = tuple(run.folder.name for run in loaded)
    if not rows:
        echo("nothing differs")
        raise Exit(0)
    width = max(len(row.name) for row in rows)
    wide = [
        max(len(_cut(one)) for one in column)
        for column in zip(names, *(r.values for r in rows), strict=True)
    ]
    for section, found in groupby(rows, key=lambda row: row.section):
        for name, values in ((section, names), *((row.name, row.values) for row in found)):
            cells = (f"{_cut(value):{w}}" for value, w in zip(values, wide, strict=True))
            echo("  ".join((f"{name:{width}}", *cells)).rstrip())
        echo("")


def _cut(value: str | None) -> str:
    return (value or "-")[:_LONGEST]
