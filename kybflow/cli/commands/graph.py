"""`kybflow graph`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from typer import Argument, Option

from kybflow.cli.arguments import Parts, Sets, Target, compiled, writing
from kybflow.core.files import write_whole


def command(
    mission: Annotated[Path, Argument(help="The mission to draw.")],
    *,
    format: Annotated[
        Literal["mermaid", "svg"], Option(help="The format of the drawing.")
    ] = "mermaid",
    out: Annotated[Path | None, Option(help="Write it to this file.")] = None,
    target: Target = None,
    sets: Sets,
    parts: Parts,
) -> None:
    """Draw each vehicle's state machine, with flight types and conditions.

    \b
    Examples:
      kybflow graph missions/figure_eight.yaml
      kybflow graph missions/figure_eight.yaml --format svg --out eight.svg
    """
    from kybflow.dsl.graph.drawing import mermaid
    from kybflow.dsl.graph.svg import svg

    plan, _ = compiled(mission, target, sets, parts)
    drawn = (svg if format == "svg" else mermaid)(plan)
    if out is None:
        sys.stdout.write(drawn)
    else:
        with writing(out, "--out"):
            write_whole(out, drawn.encode())
