"""`kybflow graph`: a mission's state machines as a picture."""

from __future__ import annotations

from pathlib import Path

from kybflow.api.findings import Answer, answer
from kybflow.dsl.graph.mermaid import mermaid
from kybflow.dsl.graph.svg import svg


def draw_mission(path: Path, form: str, target: str | None, sets: tuple[str, ...]) -> Answer:
    """Draw the mission in `path` as `mermaid` or `svg`."""
    draw = svg if form == "svg" else mermaid
    return answer(path, target, sets, lambda plan, _: draw(plan))
