"""What a mission is asked, and what the compiler found in it, as text for people."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from kybflow.dsl.compiler import Result, compile_mission
from kybflow.dsl.diagnostics.render import render_all
from kybflow.dsl.plan import Plan
from kybflow.parts.catalog import load_catalog


class Answer(NamedTuple):
    """The text, None for a mission with errors, and what was found."""

    text: str | None
    reports: list[str]


def answer(
    path: Path, target: str | None, sets: tuple[str, ...], write: Callable[[Plan, Result], str]
) -> Answer:
    """What `write` makes of the mission in `path`."""
    result = compile_mission(path, catalog=load_catalog(), target=target, sets=sets)
    plan = result.plan
    return Answer(None if plan is None else write(plan, result), findings(result, path))


def findings(result: Result, path: Path) -> list[str]:
    """A text each; that `path` is a library is one, where a mission is needed."""
    found = render_all(result.diagnostics, result.texts)
    if result.plan is None and result.valid:
        found.append(f"{path} is a library, no mission")
    return found
