"""What the commands share: their arguments, and how they print."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

INVALID = 2
"""The exit code of a mission or a command line that is invalid."""
UNWRITTEN = 1
"""The exit code of a command whose output can't be written."""


Target = Annotated[str | None, typer.Option("--target", help="Where to fly; `sim` by default.")]
Sets = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter of the mission."),
]


def examples(*lines: str) -> str:
    """The end of a command's help: an example a line, as typer breaks them at empty lines."""
    return "\n\n".join(("Examples:", *lines))


def write(path: Path, text: str, option: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        message = f"`{path}` can't be written: {error.strerror}"
        raise typer.BadParameter(message, param_hint=option) from None


def echo(text: str, err: bool = False) -> None:
    """Print `text`, in colour where there is a terminal."""
    stream = sys.stderr if err else sys.stdout
    if stream.isatty():
        from kybflow.colour import coloured

        text = coloured(text)
    stream.write(f"{text}\n")
