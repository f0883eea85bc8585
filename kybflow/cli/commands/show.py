"""`kybflow show`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from kybflow.cli.arguments import Sets, Target, compiled
from kybflow.cli.output import echo


def command(
    mission: Annotated[Path, Argument(help="The mission to show.")],
    *,
    resolved: Annotated[bool, Option("--resolved", help="All of it, line by line.")] = False,
    target: Target = None,
    sets: Sets,
) -> None:
    """What a mission does: its vehicles, states and parameters; or all of it, line by line.

    All of it is the mission after imports and defaults, with the origin of each line.

    \b
    Examples:
      kybflow show missions/figure_eight.yaml
      kybflow show missions/figure_eight.yaml --resolved --set lap=8s
    """
    from kybflow.cli.printing.mission import show_mission

    plan, found = compiled(mission, target, sets)
    echo(plan.resolved.rstrip() if resolved else show_mission(plan, found.parameters))
