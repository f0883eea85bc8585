"""Text to plan: the passes, in order. One that follows errors is skipped."""

from __future__ import annotations

from collections.abc import Mapping as MappingOf
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from kybflow.dsl import checks
from kybflow.dsl.diagnostics import Diagnostic, has_errors, in_order
from kybflow.dsl.judge import judge_mission
from kybflow.dsl.lower import lower
from kybflow.dsl.nodes import Node
from kybflow.dsl.plan import Plan, SourceFile
from kybflow.dsl.reader import read
from kybflow.dsl.resolve import Files, resolve
from kybflow.dsl.settings import FILE, parse_settings
from kybflow.dsl.shape import shape
from kybflow.dsl.source import Span
from kybflow.dsl.written import written

if TYPE_CHECKING:
    from kybflow.catalog import Catalog


@dataclass(frozen=True, slots=True)
class Result:
    """The plan, None when there are errors; the findings in order; the text of every file."""

    plan: Plan | None
    diagnostics: tuple[Diagnostic, ...]
    texts: dict[str, str] = field(default_factory=dict)


def compile_mission(
    path: str | Path, *, catalog: Catalog, target: str | None = None, sets: Sequence[str] = ()
) -> Result:
    """What the mission in `path` means on `target`, with its parameters set by `sets`
    (`name=value`). Never raises for what a file or a setting says."""
    found: list[Diagnostic] = []
    source = read(Path(path), str(path))
    found += source.found
    files = Files(source, Path(path))
    settings = parse_settings(sets, found)
    plan = None
    if source.root is not None and not has_errors(found):
        plan = _plan(source.root, files, settings, catalog, target, found)
    texts = {s.file: s.text for s in files.sources.values()} | {FILE: "\n".join(sets)}
    located = (replace(d, span=_reached(d, files)) for d in found)
    return Result(None if has_errors(found) else plan, in_order(located), texts)


def _plan(
    root: Node,
    files: Files,
    settings: MappingOf[str, Node],
    catalog: Catalog,
    target: str | None,
    found: list[Diagnostic],
) -> Plan | None:
    mission = judge_mission(root, found)
    if mission is None:
        return None
    resolved = resolve(mission, files, settings, found)
    if resolved is None:
        return None
    document = shape(resolved, catalog, target, found)
    if document is None:
        return None
    found += getattr(checks, "run_checks", lambda d, c: [])(document, catalog)
    if has_errors(found):
        return None
    sources = tuple(SourceFile(s.file, s.sha256) for s in files.sources.values())
    return lower(document, catalog, sources, written(document))


def _reached(diagnostic: Diagnostic, files: Files) -> Span:
    """The span with the imports through which its file was reached."""
    span = diagnostic.span
    via = files.via.get(span.file, ())
    return replace(span, via=via) if via else span
