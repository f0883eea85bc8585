"""`kybflow graph`."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from kybflow.cli.arguments import INVALID, Sets, Target, echo, examples, write

EXAMPLES = examples(
    "kybflow graph missions/figure_eight.yaml",
    "kybflow graph missions/figure_eight.yaml --format svg --out eight.svg",
)


class Drawing(StrEnum):
    MERMAID = "mermaid"
    SVG = "svg"


def graph(
    mission: Annotated[Path, typer.Argument(help="The mission to draw.")],
    format: Annotated[Drawing, typer.Option(help="How to draw it.")] = Drawing.MERMAID,
    out: Annotated[Path | None, typer.Option(help="Write it to this file.")] = None,
    target: Target = None,
    sets: Sets = None,
) -> None:
    """Draw each vehicle's state machine, with flight types and conditions."""
    from kybflow.cli.printing.drawing import draw_mission

    drawn = draw_mission(mission, format.value, target, tuple(sets or ()))
    for text in drawn.reports:
        echo(text, err=True)
    if drawn.text is None:
        raise typer.Exit(INVALID)
    if out is None:
        sys.stdout.write(drawn.text)
    else:
        write(out, drawn.text, "--out")
