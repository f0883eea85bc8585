"""`kybflow show`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from kybflow.cli.arguments import Parts, Sets, Target, compiled
from kybflow.cli.output import echo


def command(
    mission: Annotated[Path, Argument(help="The mission to show.")],
    *,
    resolved: Annotated[bool, Option("--resolved", help="Show the resolved mission.")] = False,
    target: Target = None,
    sets: Sets,
    parts: Parts,
) -> None:
    """Show a mission's vehicles, states and parameters.

    --resolved shows the mission after imports and defaults, with the origin of each line.

    \b
    Examples:
      kybflow show missions/figure_eight.yaml
      kybflow show missions/figure_eight.yaml --resolved --set lap=8s
    """
    from kybflow.cli.printing.mission import show_mission

    plan, found = compiled(mission, target, sets, parts)
    echo(plan.resolved.rstrip() if resolved else show_mission(plan, found.parameters))
