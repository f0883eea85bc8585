"""`kybflow validate`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import INVALID, Sets, Target, examples
from kybflow.cli.output import echo

EXAMPLES = examples(
    "kybflow validate missions/figure_eight.yaml",
    "kybflow validate missions --format sarif",
    "kybflow validate missions/figure_eight.yaml --set lap=8s",
)


class Format(StrEnum):
    TEXT = "text"
    JSON = "json"
    SARIF = "sarif"
    GITHUB = "github"


def validate(
    paths: Annotated[list[Path], typer.Argument(help="Missions, or folders with missions below.")],
    format: Annotated[
        Format, typer.Option(help="For people, programs, code scanning or GitHub Actions.")
    ] = Format.TEXT,
    target: Target = None,
    sets: Sets = None,
) -> None:
    """Prove all of a mission that can be proven before take-off.

    A folder stands for the missions and libraries in it and below: the YAML files with `kybflow`,
    `mission` or `library` at the top level. Hidden folders and those of runs are left out.

    Exit codes:

    0: every mission is valid.
    2: one is not.
    """
    raise typer.Exit(validate_all(paths, format, target, tuple(sets or ())))


def validate_all(
    paths: list[Path], format: Format, target: str | None, sets: tuple[str, ...]
) -> int:
    from kybflow.api.validation import WHOLE, validate_paths

    whole = WHOLE.get(format)
    files, valid = [], []
    for one in validate_paths(paths, target, sets):
        valid.append(one.valid)
        if whole is not None:
            files.append(one)
            continue
        for text in one.annotations if format is Format.GITHUB else one.reports:
            echo(text)
    if whole is not None:
        echo(whole(files))
    if not valid:
        echo(f"no mission is under {', '.join(map(str, paths))}", err=True)
    return 0 if valid and all(valid) else INVALID
