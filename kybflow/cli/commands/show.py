"""`kybflow show`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import Sets, Target, compiled, examples
from kybflow.cli.output import echo

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

    plan, found = compiled(mission, target, sets)
    echo(plan.resolved.rstrip() if resolved else show_mission(plan, found.parameters))
