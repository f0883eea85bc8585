"""`kybflow show`."""

from __future__ import annotations

from pathlib import Path

import click

from kybflow.cli.arguments import (
    PATH,
    Subcommand,
    argument,
    compiled,
    examples,
    set_option,
    target_option,
)
from kybflow.cli.output import echo

EXAMPLES = examples(
    "kybflow show missions/figure_eight.yaml",
    "kybflow show missions/figure_eight.yaml --resolved --set lap=8s",
)


@click.command("show", cls=Subcommand, epilog=EXAMPLES)
@argument("mission", "The mission to show.", type=PATH)
@click.option(
    "--resolved", is_flag=True, help="All of it, after imports and defaults, with origins."
)
@target_option
@set_option
def command(mission: Path, resolved: bool, target: str | None, sets: tuple[str, ...]) -> None:
    """What a mission does: its vehicles, states and parameters; or all of it, line by line."""
    from kybflow.cli.printing.mission import show_mission

    plan, found = compiled(mission, target, sets)
    echo(plan.resolved.rstrip() if resolved else show_mission(plan, found.parameters))
