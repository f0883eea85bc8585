"""The commands of kybflow, as tests look them up."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import typer
from typer.main import get_command

from kybflow.cli.app import app


def command(*names: str) -> Any:
    """The command of those names, such as `mavlink`, `setup`; the whole command line of none."""
    found: Any = get_command(app)
    for name in names:
        found = found.get_command(typer.Context(found), name)
        assert found is not None, f"there is no command {' '.join(names)}"
    return found


def commands(*above: str) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command that has no further ones, with its names."""
    found = command(*above)
    if not hasattr(found, "list_commands"):
        yield above, found
        return
    for name in found.list_commands(typer.Context(found)):
        yield from commands(*above, name)
