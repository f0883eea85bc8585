"""What the compiler found in a mission, as text for people."""

from __future__ import annotations

from pathlib import Path

from kybflow.dsl.compiler import Result
from kybflow.dsl.render import render_all


def findings(result: Result, path: Path) -> list[str]:
    """A text each; that `path` is a library is one, where a mission is needed."""
    found = render_all(result.diagnostics, result.texts)
    if result.plan is None and result.valid:
        found.append(f"{path} is a library, no mission")
    return found
