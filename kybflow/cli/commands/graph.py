"""`kybflow graph`."""

from __future__ import annotations

import sys
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
    write,
)

EXAMPLES = examples(
    "kybflow graph missions/figure_eight.yaml",
    "kybflow graph missions/figure_eight.yaml --format svg --out eight.svg",
)


@click.command("graph", cls=Subcommand, epilog=EXAMPLES)
@argument("mission", "The mission to draw.", type=PATH)
@click.option(
    "--format", type=click.Choice(["mermaid", "svg"]), default="mermaid", help="How to draw it."
)
@click.option("--out", type=PATH, help="Write it to this file.")
@target_option
@set_option
def command(
    mission: Path, format: str, out: Path | None, target: str | None, sets: tuple[str, ...]
) -> None:
    """Draw each vehicle's state machine, with flight types and conditions."""
    from kybflow.dsl.graph.mermaid import mermaid
    from kybflow.dsl.graph.svg import svg

    plan, _ = compiled(mission, target, sets)
    drawn = (svg if format == "svg" else mermaid)(plan)
    if out is None:
        sys.stdout.write(drawn)
    else:
        write(out, drawn, "--out")
