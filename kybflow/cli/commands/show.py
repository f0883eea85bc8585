"""`kybflow show`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import INVALID, Sets, Target, echo, examples

EXAMPLES = examples(
    "kybflow show missions/figure_eight.yaml",
    "kybflow show missions/figure_eight.yaml --resolved --set lap=8s",
)


def show(
    mission: Annotated[Path, typer.Argument(help="The mission to show.")],
    resolved: Annotated[
        bool,
        typer.Option("--resolved", help="All of it, after imports and defaults, with origins."),
    ] = False,
    target: Target = None,
    sets: Sets = None,
) -> None:
    """What a mission does: its vehicles, states and parameters; or all of it, line by line."""
    from kybflow.cli.printing.mission import show_mission

    shown = show_mission(mission, resolved, target, tuple(sets or ()))
    for text in shown.reports:
        echo(text, err=True)
    if shown.text is None:
        raise typer.Exit(INVALID)
    echo(shown.text)
