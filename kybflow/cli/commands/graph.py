"""`kybflow graph`."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import Sets, Target, compiled, examples, write

EXAMPLES = examples(
    "kybflow graph missions/figure_eight.yaml",
    "kybflow graph missions/figure_eight.yaml --format svg --out eight.svg",
)


class GraphFormat(StrEnum):
    MERMAID = "mermaid"
    SVG = "svg"


def graph(
    mission: Annotated[Path, typer.Argument(help="The mission to draw.")],
    format: Annotated[GraphFormat, typer.Option(help="How to draw it.")] = GraphFormat.MERMAID,
    out: Annotated[Path | None, typer.Option(help="Write it to this file.")] = None,
    target: Target = None,
    sets: Sets = None,
) -> None:
    """Draw each vehicle's state machine, with flight types and conditions."""
    from kybflow.dsl.graph.mermaid import mermaid
    from kybflow.dsl.graph.svg import svg

    plan, _ = compiled(mission, target, sets)
    drawn = (svg if format is GraphFormat.SVG else mermaid)(plan)
    if out is None:
        sys.stdout.write(drawn)
    else:
        write(out, drawn, "--out")
