"""`kybflow validate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Exit

from kybflow.cli.arguments import Format, Parts, Sets, Target, failing
from kybflow.cli.output import echo
from kybflow.core.errors import INVALID, PartError


def command(
    paths: Annotated[list[Path], Argument(help="Missions, or folders with missions below.")],
    *,
    format: Format = "text",
    target: Target = None,
    sets: Sets,
    parts: Parts,
) -> None:
    """Check missions without flying them.

    Folders are searched recursively for YAML files with `kybflow`, `mission` or `library` at the
    top level; hidden folders and run folders are skipped.

    \b
    Exit codes:
    0: every mission is valid.
    2: a mission is invalid.

    \b
    Examples:
      kybflow validate missions/figure_eight.yaml
      kybflow validate missions --format sarif
      kybflow validate missions/figure_eight.yaml --set lap=8s
    """
    from kybflow.api.validation import validate_paths, whole

    files, valid = [], []
    with failing(INVALID, PartError):
        for one in validate_paths(paths, target, sets, parts):
            valid.append(one.valid)
            if format in ("json", "sarif"):
                files.append(one)
                continue
            for text in one.annotations if format == "github" else one.reports:
                echo(text)
    if format in ("json", "sarif"):
        echo(whole(files, format))
    if not valid:
        echo(f"{', '.join(map(str, paths))}: no missions found", err=True)
    raise Exit(0 if valid and all(valid) else INVALID)
