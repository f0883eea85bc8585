"""What the commands share: their arguments, and how they print."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, cast

import typer

if TYPE_CHECKING:
    from rich.console import Console

INVALID = 2
"""The exit code of a mission or a command line that is invalid."""
UNWRITTEN = 1
"""The exit code of a command whose output can't be written."""


Target = Annotated[str | None, typer.Option("--target", help="Where to fly; `sim` by default.")]
Sets = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter of the mission."),
]
Seed = Annotated[int, typer.Option(help="Seed of everything that is drawn by chance.")]
RunOut = Annotated[Path | None, typer.Option(help="Run folder; runs/MISSION-TIME by default.")]


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
        from kybflow.cli.colour import coloured

        text = coloured(text)
    stream.write(f"{text}\n")


def console(stream: IO[str]) -> Console:
    """A console that nothing can stop: a vehicle flies."""
    from rich.console import Console

    from kybflow.cli.output import Outlet

    return Console(file=cast(IO[str], Outlet(stream)), emoji=False)
