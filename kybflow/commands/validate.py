"""`kybflow validate`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from kybflow.commands.common import INVALID, Sets, Target, echo

EXAMPLES = (
    "Examples:  kybflow validate missions/figure_eight.yaml  |  kybflow validate missions "
    "--format json  |  kybflow validate missions/figure_eight.yaml --set lap=8s"
)


class Format(StrEnum):
    TEXT = "text"
    JSON = "json"


def validate(
    paths: Annotated[list[Path], typer.Argument(help="Missions, or folders of missions.")],
    format: Annotated[Format, typer.Option(help="For people or for programs.")] = Format.TEXT,
    target: Target = None,
    sets: Sets = None,
) -> None:
    """Prove all of a mission that can be proven before take-off.

    Exit code 0: every mission is valid. 2: one is not.
    """
    raise typer.Exit(validate_all(paths, format, target, tuple(sets or ())))


def validate_all(
    paths: list[Path], format: Format, target: str | None, sets: tuple[str, ...]
) -> int:
    from kybflow.validation import report_text, validate_paths

    files = []
    for one in validate_paths(paths, target, sets):
        files.append(one.summary if format is Format.JSON else {"valid": one.valid})
        for text in one.reports if format is Format.TEXT else ():
            echo(text)
    if format is Format.JSON:
        echo(report_text(files))
    if not files:
        echo(f"no mission is under {', '.join(map(str, paths))}", err=True)
    return 0 if files and all(file["valid"] for file in files) else INVALID
