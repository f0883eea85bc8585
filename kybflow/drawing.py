"""`kybflow graph`: a mission's state machines as a picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from kybflow.catalog import load_catalog
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.graph import mermaid, svg
from kybflow.findings import findings


@dataclass(frozen=True, slots=True)
class Drawn:
    """The drawing, None for a mission with errors, and what was found."""

    text: str | None
    reports: list[str]


def draw_mission(path: Path, form: str, target: str | None, sets: tuple[str, ...]) -> Drawn:
    """Draw the mission in `path` as `mermaid` or `svg`."""
    result = compile_mission(path, catalog=load_catalog(), target=target, sets=sets)
    reports = findings(result, path)
    if result.plan is None:
        return Drawn(None, reports)
    return Drawn(svg(result.plan) if form == "svg" else mermaid(result.plan), reports)
