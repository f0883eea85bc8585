"""The arguments that several commands have, and what becomes of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from kybflow.cli.output import echo

if TYPE_CHECKING:
    from kybflow.dsl.compiler import Result
    from kybflow.dsl.plan import Plan

INVALID = 2
"""The exit code of a mission or a command line that is invalid."""

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


def compiled(
    mission: Path, target: str | None = None, sets: Sequence[str] | None = None
) -> tuple[Plan, Result]:
    """Compile a mission and print its findings. Exits with INVALID where it has no plan."""
    from kybflow.api.validation import findings
    from kybflow.dsl.compiler import compile_mission
    from kybflow.parts.catalog import load_catalog

    result = compile_mission(mission, catalog=load_catalog(), target=target, sets=tuple(sets or ()))
    for text in findings(result, mission):
        echo(text, err=True)
    if result.plan is None:
        raise typer.Exit(INVALID)
    return result.plan, result


def write(path: Path, text: str, option: str) -> None:
    """Write the file that `option` names."""
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        message = f"`{path}` can't be written: {error.strerror}"
        raise typer.BadParameter(message, param_hint=option) from None


def published(
    text: Callable[[], str], command: str, write_to: Path | None, check: Path | None
) -> bool:
    """Write the generated file to `write_to`, or exit with INVALID unless `check` is current;
    whether either was asked for. command: what makes the file, for the message."""
    if write_to is not None:
        write(write_to, text(), "--write")
    elif check is not None and not (
        check.is_file() and check.read_text(encoding="utf-8") == text()
    ):
        echo(f"{check} is not current; mend it with: {command} --write {check}", err=True)
        raise typer.Exit(INVALID)
    return write_to is not None or check is not None
