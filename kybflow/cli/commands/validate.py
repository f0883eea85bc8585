"""`kybflow validate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Exit

from kybflow.cli.arguments import Format, Sets, Target
from kybflow.cli.output import echo
from kybflow.core.exit_codes import INVALID


def command(
    paths: Annotated[list[Path], Argument(help="Missions, or folders with missions below.")],
    *,
    format: Format = "text",
    target: Target = None,
    sets: Sets,
) -> None:
    """Prove all of a mission that can be proven before take-off.

    A folder stands for the missions and libraries in it and below: the YAML files with `kybflow`,
    `mission` or `library` at the top level. Hidden folders and those of runs are left out.

    \b
    Exit codes:
    0: every mission is valid.
    2: one is not.

    \b
    Examples:
      kybflow validate missions/figure_eight.yaml
      kybflow validate missions --format sarif
      kybflow validate missions/figure_eight.yaml --set lap=8s
    """
    from kybflow.api.validation import WHOLE, validate_paths

    whole = WHOLE.get(format)
    files, valid = [], []
    for one in validate_paths(paths, target, sets):
        valid.append(one.valid)
        if whole is not None:
            files.append(one)
            continue
        for text in one.annotations if format == "github" else one.reports:
            echo(text)
    if whole is not None:
        echo(whole(files))
    if not valid:
        echo(f"no mission is under {', '.join(map(str, paths))}", err=True)
    raise Exit(0 if valid and all(valid) else INVALID)
